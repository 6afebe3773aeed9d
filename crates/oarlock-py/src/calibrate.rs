//! Python functions of the calibrations: mounts, lever arms, joints, magnetic field. `oarlock.calibration` calls them.

use crate::array::{items, reals, Any};
use crate::errors::DataError;
use crate::run::detached;
use oarlock::calibrate::chain_sensor::{ChainOptions, ChainSensor};
use oarlock::calibrate::hinge_axes::{hinge_axis, AxisOptions, NominalAxis};
use oarlock::calibrate::hinge_chain::{mounts, FoundMount};
use oarlock::calibrate::joint_centers::{joint_center, CenterOptions};
use oarlock::calibrate::lever_arms::{lever_arms, LeverOptions};
use oarlock::calibrate::local_field::{local_field, FieldOptions, MagneticUnit};
use oarlock::calibrate::magnetic::{magnetic_field, FoundField, MagneticOptions};
use oarlock::calibrate::pose_mounts::{pose_mounts, PoseOptions, PosedUnit};
use oarlock::calibrate::signals::Signals;
use oarlock::calibrate::GoOn;
use oarlock::rotation::Mat3;
use pyo3::prelude::*;
use serde::Serialize;
use serde_json::json;

type Rows = Vec<[f64; 3]>;

/// Columns of one unit, owned, so that a search runs without the interpreter's lock.
struct Unit {
    name: String,
    time_s: Vec<f64>,
    gyro_rad_s: Rows,
    accel_m_s2: Rows,
    mag_ut: Option<Rows>,
}

/// A unit with its place in a hinge chain.
struct Link {
    unit: Unit,
    world_from_link: Mat3<f64>,
    hinge_axis_in_world: [f64; 3],
    swing_s: Option<(f64, f64)>,
}

impl Unit {
    /// From a mapping of name, time_s (T,), gyro_rad_s, accel_m_s2 and mag_ut (T, 3); mag_ut may be None.
    fn read(entry: &Any<'_>) -> PyResult<Self> {
        let name: String = entry.get_item("name")?.extract()?;
        let label = |key: &str| format!("sensor '{name}', {key}");
        let rows = |key: &str| -> PyResult<Rows> {
            let (array, _) = items(&entry.get_item(key)?, &label(key), &[3])?;
            Ok(array.values.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect())
        };
        Ok(Unit {
            time_s: reals(&entry.get_item("time_s")?, &label("time_s"))?.values,
            gyro_rad_s: rows("gyro_rad_s")?,
            accel_m_s2: rows("accel_m_s2")?,
            mag_ut: if entry.get_item("mag_ut")?.is_none() { None } else { Some(rows("mag_ut")?) },
            name,
        })
    }

    fn signals(&self) -> Signals<'_> {
        Signals { name: &self.name, time_s: &self.time_s, gyro_rad_s: &self.gyro_rad_s, accel_m_s2: &self.accel_m_s2 }
    }
}

impl Link {
    fn read(entry: &Any<'_>) -> PyResult<Self> {
        Ok(Link {
            unit: Unit::read(entry)?,
            world_from_link: Mat3(entry.get_item("world_from_link")?.extract()?),
            hinge_axis_in_world: entry.get_item("hinge_axis_in_world")?.extract()?,
            swing_s: entry.get_item("swing_s")?.extract()?,
        })
    }

    fn borrow(&self) -> ChainSensor<'_> {
        ChainSensor {
            name: &self.unit.name,
            world_from_link: self.world_from_link,
            hinge_axis_in_world: self.hinge_axis_in_world,
            time_s: &self.unit.time_s,
            gyro_rad_s: &self.unit.gyro_rad_s,
            accel_m_s2: &self.unit.accel_m_s2,
            swing_s: self.swing_s,
        }
    }
}

/// What a search finds without the interpreter's lock, for Python: dictionaries by field name, lists; NaN becomes None.
/// Ctrl-C stops it.
fn found<'py, T: Serialize + Send>(
    py: Python<'py>,
    search: impl FnOnce(GoOn) -> oarlock::Result<T> + Send,
) -> PyResult<Any<'py>> {
    let found = detached(py, None, |told| search(&mut || told(0.0)))?;
    let json = serde_json::to_string(&found).map_err(|e| DataError::new_err(e.to_string()))?;
    py.import("json")?.call_method1("loads", (json,))
}

fn units(entries: &[Any<'_>]) -> PyResult<Vec<Unit>> {
    entries.iter().map(Unit::read).collect()
}

/// Mounts, lever arms and magnetic field of a chain of hinges.
///
/// `sensors`, from base to tip, are units that also have world_from_link (3, 3) and hinge_axis_in_world (3,) (both
/// lists, in the posture of the still stretch), and swing_s (start, end) or None. Returns a dictionary of `mounts` and
/// `lever_arms`, one entry per sensor, and `field`, which is None without magnetometers.
#[pyfunction]
pub fn find_hinge_chain<'py>(
    py: Python<'py>,
    sensors: Vec<Any<'py>>,
    up_in_world: [f64; 3],
    gravity_m_s2: f64,
    still_s: Option<(f64, f64)>,
    first_turn_positive: bool,
) -> PyResult<Any<'py>> {
    let links = sensors.iter().map(Link::read).collect::<PyResult<Vec<_>>>()?;
    let options = ChainOptions { still_s, first_turn_positive, ..ChainOptions::default() };
    let levers = LeverOptions { gravity_m_s2, ..LeverOptions::default() };
    found(py, |go_on| {
        let chain: Vec<ChainSensor> = links.iter().map(Link::borrow).collect();
        let mounts = mounts(&chain, up_in_world, &options)?;
        let arms = lever_arms(&chain, &mounts, up_in_world, &levers, go_on)?;
        let field = field_of(&links, &chain, &mounts, go_on)?;
        Ok(json!({ "mounts": mounts, "lever_arms": arms, "field": field }))
    })
}

/// The joint between the bodies of two units; `expected` is the vector from joint to unit in each one's sensor axes, m.
#[pyfunction]
pub fn find_joint_center<'py>(
    py: Python<'py>,
    first: Any<'py>,
    second: Any<'py>,
    expected: [[f64; 3]; 2],
    window_s: f64,
    prior_std_m: f64,
) -> PyResult<Any<'py>> {
    let (first, second) = (Unit::read(&first)?, Unit::read(&second)?);
    let options = CenterOptions { window_s, prior_std_m, ..CenterOptions::default() };
    found(py, |go_on| joint_center([&first.signals(), &second.signals()], expected, &options, go_on))
}

/// The axis of the hinge between the bodies of two units, in each one's sensor axes. `nominal` has the axis in both, by
/// their nominal mounts, `prior_std_rad` how well these are known.
#[pyfunction]
pub fn find_hinge_axis<'py>(
    py: Python<'py>,
    first: Any<'py>,
    second: Any<'py>,
    nominal: [[f64; 3]; 2],
    prior_std_rad: [f64; 2],
    window_s: f64,
) -> PyResult<Any<'py>> {
    let (one, two) = (Unit::read(&first)?, Unit::read(&second)?);
    let options = AxisOptions { window_s, ..AxisOptions::default() };
    let nominal = NominalAxis { axes: nominal, std_rad: prior_std_rad };
    found(py, |go_on| hinge_axis([&one.signals(), &two.signals()], &nominal, &options, go_on))
}

/// Mounts of units at rest in a known posture: each also has link_from_sensor and world_from_link (3, 3), lists.
#[pyfunction]
pub fn find_pose_mounts<'py>(
    py: Python<'py>,
    sensors: Vec<Any<'py>>,
    up_in_world: [f64; 3],
    still_s: Option<(f64, f64)>,
    posture_std_rad: f64,
) -> PyResult<Any<'py>> {
    let owned = units(&sensors)?;
    let rotation = |at: usize, key: &str| PyResult::Ok(Mat3(sensors[at].get_item(key)?.extract()?));
    let posed = |(at, unit)| -> PyResult<PosedUnit> {
        let (link_from_sensor, world_from_link) = (rotation(at, "link_from_sensor")?, rotation(at, "world_from_link")?);
        Ok(PosedUnit { signals: Unit::signals(unit), link_from_sensor, world_from_link })
    };
    let posed = owned.iter().enumerate().map(posed).collect::<PyResult<Vec<_>>>()?;
    let options = PoseOptions { still_s, posture_std_rad, ..PoseOptions::default() };
    found(py, |_| pose_mounts(&posed, up_in_world, &options))
}

/// Norm and dip of the magnetic field around units that all have a magnetometer.
#[pyfunction]
pub fn find_local_field<'py>(py: Python<'py>, sensors: Vec<Any<'py>>) -> PyResult<Any<'py>> {
    let owned = units(&sensors)?;
    let magnetic: Vec<MagneticUnit> =
        owned.iter().filter_map(|unit| Some((unit.signals(), unit.mag_ut.as_deref()?))).collect();
    found(py, |_| local_field(&magnetic, &FieldOptions::default()))
}

/// Readings of the sensors that have a magnetometer.
fn field_of(
    links: &[Link],
    chain: &[ChainSensor],
    found: &[FoundMount],
    go_on: GoOn,
) -> oarlock::Result<Option<FoundField>> {
    let (mut sensors, mut columns, mut mounts) = (Vec::new(), Vec::new(), Vec::new());
    for ((link, sensor), mount) in links.iter().zip(chain).zip(found) {
        if let Some(mag_ut) = &link.unit.mag_ut {
            sensors.push(*sensor);
            columns.push(mag_ut.as_slice());
            mounts.push(mount.clone());
        }
    }
    if sensors.is_empty() {
        return Ok(None);
    }
    magnetic_field(&sensors, &columns, &mounts, &MagneticOptions::default(), go_on).map(Some)
}
