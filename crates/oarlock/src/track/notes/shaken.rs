//! Notes on sensors that vibrated.

use crate::track::run::Run;
use crate::track::vibration::Shaken;

/// Share of the time above which a note reports vibration.
const SHARE: f64 = 0.05;

/// One note for each sensor that vibrated.
pub(super) fn notes(run: &Run) -> Vec<String> {
    let (Some(last), Some(first_s)) = (run.last(), run.series.time_s.first()) else { return Vec::new() };
    let duration_s = last.belief.time_s - first_s;
    let note = |name: &str, what: &str, unit: &str, shaken: &Shaken| {
        let share = shaken.shaken_s / duration_s;
        (share > SHARE).then(|| {
            format!(
                "{name}: its {what} vibrated faster than limbs move in {:.0} % of the time, by up to {:.1} {unit}, and had less weight there; \
                 mount the unit more firmly, and away from engines and telephones",
                100.0 * share,
                shaken.peak.sqrt()
            )
        })
    };
    let names = run.tracker().body().suite.sources.iter().map(|s| s.name.as_str());
    let of_unit = |(name, memory): (&str, &crate::track::hypothesis::SourceMemory)| {
        let (gyro, accel) = (&memory.vibration.gyro, &memory.vibration.accel);
        [note(name, "gyroscope", "rad/s", gyro), note(name, "accelerometer", "m/s2", accel)]
    };
    names.zip(&last.sources).flat_map(of_unit).flatten().collect()
}
