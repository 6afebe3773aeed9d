//! What the factorised filter loses against the unscented one, and what it says of itself.

use super::bodies::walker;
use super::support::nature::Sums;
use super::support::record::on_a_stroke;
use super::support::{body, model, plain, start_std};
use oarlock::config::{Config, FilterKind};

const BOTH: [FilterKind; 2] = [FilterKind::Ukf, FilterKind::Factorised];

/// What two arms know of each other beyond the trunk is worth less than this.
const NEARLY: f64 = 1.1;

/// Start, gates, learning, holes and smoother as they come.
#[test]
fn a_stroke_is_tracked_nearly_as_well() {
    let errors = BOTH.map(on_a_stroke);
    let [ukf, factorised] = [errors[0], errors[1]];
    assert!(factorised[1] < factorised[0], "smoothing is to help");
    assert!(factorised[0] < NEARLY * ukf[0] && factorised[1] < NEARLY * ukf[1], "{errors:?}");
}

/// What is dropped makes the filter too sure: its errors are larger than it says by less than a fifth (squared, 1.44), on a body whose
/// floating pelvis ties its legs together more than any trunk does.
const SURER: f64 = 1.44;

/// Over runs drawn from the filter's own model.
fn consistency(filter: FilterKind) -> [f64; 2] {
    let config = Config { filter, ..plain(&["gyro_bias", "accel_bias", "surge"]) };
    let body = body(&model(&walker()), &config);
    let std: Vec<f64> = start_std(&body).iter().map(|s| s.min(0.1)).collect();
    Sums::of(&body, &config, &std, [60, 100], 500).shares()
}

#[test]
fn errors_are_nearly_as_large_as_said() {
    let [ukf, factorised] = BOTH.map(consistency);
    println!(
        "walker: NEES {:.4} of ukf, {:.4} limb by limb; NIS {:.4}, {:.4}",
        ukf[0], factorised[0], ukf[1], factorised[1]
    );
    assert!(factorised[0] < SURER * ukf[0] && ukf[0] < SURER, "{ukf:?} {factorised:?}");
    // Six hundred thousand readings leave the mean square of innovations to the third digit.
    assert!((factorised[1] - 1.0).abs() < 0.01, "{factorised:?}");
}
