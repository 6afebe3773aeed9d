//! Cases from seeds, one after the other, each watched.

use super::support::chance::Chance;
use std::panic::{catch_unwind, resume_unwind, AssertUnwindSafe};
use std::sync::mpsc::{channel, RecvTimeoutError};
use std::time::{Duration, Instant};

/// A case that takes longer hangs: the slowest of an hour take two seconds of a processor, which a crowded machine may spread
/// over minutes.
const HANG_S: u64 = 600;

fn from_environment(name: &str) -> Option<u64> {
    let text = std::env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name} = {text}: expected a whole number")))
}

/// Runs `case` for each seed, `cases` times or for as long as the environment says. `case` gets randomness and a place to write
/// down what it feeds, for the report of a failure.
pub fn campaign(name: &str, cases: u64, case: impl Fn(&mut Chance, &mut String)) {
    let limit = from_environment("OARLOCK_FUZZ_SECONDS").map(Duration::from_secs);
    let first = from_environment("OARLOCK_FUZZ_SEED").unwrap_or(0);
    let only = from_environment("OARLOCK_FUZZ_ONLY");
    let (began, mut seed) = (Instant::now(), only.unwrap_or(first));
    let (tell, heard) = channel();
    let title = name.to_string();
    let watch = std::thread::spawn(move || watch(&title, &heard));
    while only.is_none_or(|only| seed == only) && limit.map_or(seed < first + cases, |limit| began.elapsed() < limit) {
        tell.send(seed).expect("the watch waits for the end");
        one(name, seed, &case);
        seed += 1;
    }
    drop(tell);
    watch.join().expect("the watch ends");
    eprintln!("fuzz {name}: {} cases in {:.0} s", seed - only.unwrap_or(first), began.elapsed().as_secs_f64());
}

fn one(name: &str, seed: u64, case: &impl Fn(&mut Chance, &mut String)) {
    let mut fed = String::new();
    let outcome = catch_unwind(AssertUnwindSafe(|| case(&mut Chance::new(seed), &mut fed)));
    if let Err(panic) = outcome {
        eprintln!("fuzz {name}, OARLOCK_FUZZ_ONLY={seed}: fed\n{fed}\nfuzz {name}: seed {seed} failed");
        resume_unwind(panic);
    }
}

/// Ends the process when no next case begins in time: a loop that never ends cannot be unwound.
fn watch(name: &str, heard: &std::sync::mpsc::Receiver<u64>) {
    let mut current = None;
    loop {
        match heard.recv_timeout(Duration::from_secs(HANG_S)) {
            Ok(seed) => current = Some(seed),
            Err(RecvTimeoutError::Disconnected) => return,
            Err(RecvTimeoutError::Timeout) => {
                eprintln!("fuzz {name}: seed {current:?} has hung for {HANG_S} s");
                std::process::exit(101);
            }
        }
    }
}
