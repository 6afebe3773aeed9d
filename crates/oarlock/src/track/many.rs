//! Tracks several recordings in parallel, each as if it were alone. The Python `track_many` uses it.

use super::notes::notes;
use super::run::{track, Progress, Run};
use super::score::{score, Score};
use super::Calibration;
use crate::config::Config;
use crate::error::{Error, Result};
use crate::model::Model;
use crate::recording::Stream;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{channel, Receiver, RecvTimeoutError};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A recording to track, with model and options.
#[derive(Debug, Clone)]
pub struct Job {
    /// The body.
    pub model: Arc<Model>,
    /// Its streams.
    pub streams: Vec<Stream>,
    /// Calibration of this recording.
    pub calibration: Calibration,
    /// Configuration of this run.
    pub config: Config,
    /// Whether to smooth; then only the smoothed track is kept.
    pub smooth: bool,
}

/// A recording that was tracked to its end.
#[derive(Debug, Clone)]
pub struct Done {
    /// The track, smoothed if requested.
    pub run: Run,
    /// Notes on the track.
    pub notes: Vec<String>,
    /// Wall time of filtering, s.
    pub wall_s: f64,
    /// Wall time of smoothing, s.
    pub smoothing_wall_s: Option<f64>,
}

/// Interval at which progress is reported and the caller can stop the work.
const TELL_EVERY: Duration = Duration::from_millis(50);

/// Tracks every job independently. Results are in the order of the jobs. A failed job returns its error and does not
/// affect the others. No result depends on the number of threads; `None` means all cores.
///
/// The calling thread calls `progress`; if it returns false, all work ends in `Error::Stopped`.
pub fn track_many(jobs: Vec<Job>, threads: Option<usize>, progress: Progress) -> Result<Vec<Result<Done>>> {
    side_by_side(jobs, threads, Job::run, progress)
}

/// Scores every job independently, as `track_many` does. `smooth` of the jobs is ignored.
pub fn score_many(
    jobs: Vec<Job>,
    span_s: (f64, f64),
    threads: Option<usize>,
    progress: Progress,
) -> Result<Vec<Result<Score>>> {
    let one = |j: Job, p: Progress<'_>| score(j.model, j.streams, &j.calibration, &j.config, span_s, p);
    side_by_side(jobs, threads, one, progress)
}

fn side_by_side<T: Send>(
    jobs: Vec<Job>,
    threads: Option<usize>,
    work: impl Fn(Job, Progress<'_>) -> Result<T> + Sync,
    progress: Progress,
) -> Result<Vec<Result<T>>> {
    if jobs.is_empty() {
        return Ok(Vec::new());
    }
    let pool = pool(threads, jobs.len())?;
    let watch = Watch::over(jobs.len());
    let mut results: Vec<Result<T>> = jobs.iter().map(|_| Err(Error::Stopped)).collect();
    let (sender, receiver) = channel();
    pool.in_place_scope_fifo(|scope| {
        for (index, job) in jobs.into_iter().enumerate() {
            let (sender, watch, work) = (sender.clone(), &watch, &work);
            scope.spawn_fifo(move |_| {
                // Queued jobs do not start once the work is stopped.
                let go = watch.go_on(index, 0.0);
                let result = if go { work(job, &mut |share| watch.go_on(index, share)) } else { Err(Error::Stopped) };
                // Sending fails only if the receiver is gone; nobody needs the result then.
                let _ = sender.send((index, result));
            });
        }
        drop(sender);
        watch.collect(&receiver, &mut results, progress);
    });
    if watch.stop.into_inner() {
        return Err(Error::Stopped);
    }
    Ok(results)
}

fn pool(threads: Option<usize>, jobs: usize) -> Result<ThreadPool> {
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let threads = threads.unwrap_or_else(cores);
    if threads == 0 {
        return Err(Error::Data("threads = 0: nothing can run; give 1 or more, or none for all cores".into()));
    }
    let threads = threads.min(jobs);
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| Error::Data(format!("{threads} threads could not be started ({e}): give fewer")))
}

impl Job {
    fn run(self, progress: Progress) -> Result<Done> {
        let part = if self.smooth { 0.5 } else { 1.0 };
        let begun = Instant::now();
        let run = track(self.model, self.streams, &self.calibration, &self.config, None, &mut |s| progress(part * s))?;
        let wall_s = begun.elapsed().as_secs_f64();
        if !self.smooth {
            return Ok(Done { notes: notes(&run), run, wall_s, smoothing_wall_s: None });
        }
        let begun = Instant::now();
        let run = run.into_smooth(&mut |s| progress(part * (1.0 + s)))?;
        Ok(Done { notes: notes(&run), run, wall_s, smoothing_wall_s: Some(begun.elapsed().as_secs_f64()) })
    }
}

/// State shared by the workers and the calling thread.
struct Watch {
    /// Per job: bits of the finished share.
    shares: Vec<AtomicU64>,
    stop: AtomicBool,
}

impl Watch {
    fn over(jobs: usize) -> Self {
        let shares = (0..jobs).map(|_| AtomicU64::new(0.0_f64.to_bits())).collect();
        Watch { shares, stop: AtomicBool::new(false) }
    }

    /// Reports a worker's progress; false if it must stop.
    fn go_on(&self, index: usize, share: f64) -> bool {
        self.shares[index].store(share.to_bits(), Ordering::Relaxed);
        !self.stop.load(Ordering::Relaxed)
    }

    fn share(&self) -> f64 {
        let done = |s: &AtomicU64| f64::from_bits(s.load(Ordering::Relaxed));
        self.shares.iter().map(done).sum::<f64>() / self.shares.len() as f64
    }

    /// Receives the results until every worker has sent its own.
    fn collect<T>(&self, receiver: &Receiver<(usize, Result<T>)>, results: &mut [Result<T>], progress: Progress) {
        loop {
            match receiver.recv_timeout(TELL_EVERY) {
                Ok((index, result)) => {
                    results[index] = result;
                    self.shares[index].store(1.0_f64.to_bits(), Ordering::Relaxed);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            if !self.stop.load(Ordering::Relaxed) && !progress(self.share()) {
                self.stop.store(true, Ordering::Relaxed);
            }
        }
    }
}
