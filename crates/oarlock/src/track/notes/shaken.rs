//! Notes on sensors that vibrated.

use crate::recording::Stream;
use crate::sensor::{Quantity, Source};
use crate::track::run::Run;
use crate::track::vibration;

/// Share of the time above which a note reports vibration.
const SHARE: f64 = 0.05;

/// One note for each sensor that vibrated.
pub(super) fn notes(run: &Run) -> Vec<String> {
    let sources = &run.tracker().body().suite.sources;
    let of_stream = |stream: &Stream| {
        let source = sources.iter().find(|s| s.name == stream.name);
        source.map_or_else(Vec::new, |source| of_source(source, stream))
    };
    run.recording().streams().flat_map(of_stream).collect()
}

fn of_source(source: &Source, stream: &Stream) -> Vec<String> {
    let note = |(quantity, what, unit)| {
        let channel = stream.channels.iter().find(|c| c.quantity == quantity)?;
        let std =
            source.std[source.parts.iter().find(|p| p.quantity == quantity)?.rows.start - source.parts[0].rows.start];
        let found = vibration::of(stream, channel, std * std)?;
        (found.share > SHARE).then(|| {
            format!(
                "{}: its {what} vibrated faster than limbs move in {:.0} % of the time, by up to {:.1} {unit} (RMS); mount \
                 the unit more firmly, and away from engines and telephones",
                source.name,
                100.0 * found.share,
                found.peak
            )
        })
    };
    let kinds = [(Quantity::Gyro, "gyroscope", "rad/s"), (Quantity::Accel, "accelerometer", "m/s2")];
    kinds.into_iter().filter_map(note).collect()
}
