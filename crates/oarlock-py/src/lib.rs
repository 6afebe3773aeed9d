//! Python extension module `oarlock._core`: converts names, arrays, tables and errors, and computes nothing itself.

mod array;
mod belief;
mod calibrate;
mod config;
mod corrections;
mod csv;
mod errors;
mod jacobian;
mod lent;
mod model;
mod motion;
mod parquet;
mod parquet_bounds;
mod race;
mod run;
mod score;
mod simulate;
mod streams;
mod table;
mod tracker;

use pyo3::prelude::*;

#[pymodule]
fn _core(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add_class::<model::PyModel>()?;
    m.add_class::<config::PyConfig>()?;
    m.add_class::<belief::PyBelief>()?;
    m.add_class::<belief::PyInfo>()?;
    m.add_class::<run::PyRun>()?;
    m.add_class::<tracker::PySample>()?;
    m.add_class::<tracker::PyTracker>()?;
    m.add_function(wrap_pyfunction!(corrections::true_times_s, m)?)?;
    m.add_function(wrap_pyfunction!(corrections::encoder_values, m)?)?;
    m.add_function(wrap_pyfunction!(corrections::corrected_readings, m)?)?;
    m.add_function(wrap_pyfunction!(run::track, m)?)?;
    m.add_function(wrap_pyfunction!(run::track_many, m)?)?;
    m.add_function(wrap_pyfunction!(score::score_many, m)?)?;
    m.add_function(wrap_pyfunction!(race::race, m)?)?;
    m.add_function(wrap_pyfunction!(simulate::imu_signals, m)?)?;
    m.add_function(wrap_pyfunction!(calibrate::find_hinge_chain, m)?)?;
    m.add_function(wrap_pyfunction!(calibrate::find_joint_center, m)?)?;
    m.add_function(wrap_pyfunction!(calibrate::find_hinge_axis, m)?)?;
    m.add_function(wrap_pyfunction!(calibrate::find_pose_mounts, m)?)?;
    m.add_function(wrap_pyfunction!(calibrate::find_local_field, m)?)?;
    m.add_function(wrap_pyfunction!(parquet::read_parquet, m)?)?;
    m.add_function(wrap_pyfunction!(parquet::write_parquet, m)?)?;
    m.add_function(wrap_pyfunction!(csv::read_csv, m)?)?;
    m.add_function(wrap_pyfunction!(csv::write_csv, m)?)?;
    Ok(())
}
