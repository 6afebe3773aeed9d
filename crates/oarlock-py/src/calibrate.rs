//! What a still stretch and a swing tell about the sensors of a hinge chain.

use crate::array::{items, reals};
use crate::errors::raise;
use oarlock::calibrate::hinge_chain::{mounts, ChainOptions, ChainSensor, FoundMount};
use oarlock::calibrate::lever_arms::{lever_arms, FoundLever, LeverOptions};
use oarlock::calibrate::magnetic::{magnetic_field, FoundField, FoundOffset, MagneticOptions};
use oarlock::rotation::Mat3;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

type Rows = Vec<[f64; 3]>;
type Entry<'py> = PyResult<Bound<'py, PyDict>>;

/// One sensor's columns, owned, so that the search runs without the interpreter's lock.
struct Link {
    name: String,
    world_from_link: Mat3<f64>,
    hinge_axis_in_world: [f64; 3],
    time_s: Vec<f64>,
    gyro_rad_s: Rows,
    accel_m_s2: Rows,
    mag_ut: Option<Rows>,
    swing_s: Option<(f64, f64)>,
}

/// Mounts, lever arms and magnetic field of a chain of hinges.
///
/// `sensors`, base to tip, are mappings of name, world_from_link (3, 3) and hinge_axis_in_world (3,) (both lists, in the
/// posture of the still stretch), time_s (T,), gyro_rad_s, accel_m_s2 and mag_ut (T, 3) (mag_ut may be None), swing_s (start, end) or
/// None. Returns a dictionary of `mounts` and `lever_arms`, one entry a sensor, and `field`, None without magnetometers.
#[pyfunction]
pub fn find_hinge_chain<'py>(
    py: Python<'py>,
    sensors: Vec<Bound<'py, PyAny>>,
    up_in_world: [f64; 3],
    gravity_m_s2: f64,
    still_s: Option<(f64, f64)>,
    first_turn_positive: bool,
) -> Entry<'py> {
    let links = sensors.iter().map(Link::read).collect::<PyResult<Vec<_>>>()?;
    let options = ChainOptions { still_s, first_turn_positive, ..ChainOptions::default() };
    let levers = LeverOptions { gravity_m_s2, ..LeverOptions::default() };
    let (mounts, arms, field) = py
        .detach(|| {
            let chain: Vec<ChainSensor> = links.iter().map(Link::borrow).collect();
            let found = mounts(&chain, up_in_world, &options)?;
            let arms = lever_arms(&chain, &found, up_in_world, &levers)?;
            let field = field_of(&links, &chain, &found)?;
            Ok((found, arms, field))
        })
        .map_err(|e| raise(py, e))?;
    let out = PyDict::new(py);
    out.set_item("mounts", list(py, mounts.iter().map(|m| mount_entry(py, m)))?)?;
    out.set_item("lever_arms", list(py, arms.iter().map(|a| lever_entry(py, a)))?)?;
    out.set_item("field", field.map(|f| field_entry(py, &f)).transpose()?)?;
    Ok(out)
}

/// Of those sensors that have a magnetometer.
fn field_of(links: &[Link], chain: &[ChainSensor], found: &[FoundMount]) -> oarlock::Result<Option<FoundField>> {
    let (mut sensors, mut columns, mut mounts) = (Vec::new(), Vec::new(), Vec::new());
    for ((link, sensor), mount) in links.iter().zip(chain).zip(found) {
        if let Some(mag_ut) = &link.mag_ut {
            sensors.push(*sensor);
            columns.push(mag_ut.as_slice());
            mounts.push(mount.clone());
        }
    }
    if sensors.is_empty() {
        return Ok(None);
    }
    magnetic_field(&sensors, &columns, &mounts, &MagneticOptions::default()).map(Some)
}

impl Link {
    fn read(entry: &Bound<'_, PyAny>) -> PyResult<Self> {
        let name: String = entry.get_item("name")?.extract()?;
        let label = |key: &str| format!("sensor '{name}', {key}");
        let rows = |key: &str| -> PyResult<Rows> {
            let (array, _) = items(&entry.get_item(key)?, &label(key), &[3])?;
            Ok(array.values.chunks_exact(3).map(|v| [v[0], v[1], v[2]]).collect())
        };
        Ok(Link {
            world_from_link: Mat3(entry.get_item("world_from_link")?.extract()?),
            hinge_axis_in_world: entry.get_item("hinge_axis_in_world")?.extract()?,
            time_s: reals(&entry.get_item("time_s")?, &label("time_s"))?.values,
            gyro_rad_s: rows("gyro_rad_s")?,
            accel_m_s2: rows("accel_m_s2")?,
            mag_ut: if entry.get_item("mag_ut")?.is_none() { None } else { Some(rows("mag_ut")?) },
            swing_s: entry.get_item("swing_s")?.extract()?,
            name,
        })
    }

    fn borrow(&self) -> ChainSensor<'_> {
        ChainSensor {
            name: &self.name,
            world_from_link: self.world_from_link,
            hinge_axis_in_world: self.hinge_axis_in_world,
            time_s: &self.time_s,
            gyro_rad_s: &self.gyro_rad_s,
            accel_m_s2: &self.accel_m_s2,
            swing_s: self.swing_s,
        }
    }
}

fn list<'py>(py: Python<'py>, entries: impl Iterator<Item = Entry<'py>>) -> PyResult<Bound<'py, PyList>> {
    PyList::new(py, entries.collect::<PyResult<Vec<_>>>()?)
}

macro_rules! entry {
    ($py:expr, $from:expr, $($field:ident),+) => {{
        let entry = PyDict::new($py);
        $(entry.set_item(stringify!($field), $from.$field.clone())?;)+
        entry
    }};
}

fn mount_entry<'py>(py: Python<'py>, m: &FoundMount) -> Entry<'py> {
    let out = entry!(
        py,
        m,
        name,
        std_about_hinge_rad,
        std_about_up_rad,
        std_about_third_rad,
        disagreement_rad,
        axis_moved_rad,
        axis_in_sensor,
        off_axis_share,
        neighbour_correlation,
        swing_range_rad,
        gyro_bias_rad_s,
        gyro_noise_rad_s,
        accel_noise_m_s2,
        accel_norm_m_s2,
        still_s
    );
    out.set_item("link_from_sensor", m.link_from_sensor.0)?;
    Ok(out)
}

fn lever_entry<'py>(py: Python<'py>, a: &FoundLever) -> Entry<'py> {
    Ok(entry!(py, a, name, offset_m, offset_std_m, to_next_hinge_m, residual_m_s2, constant_m_s2))
}

fn field_entry<'py>(py: Python<'py>, f: &FoundField) -> Entry<'py> {
    let out = entry!(py, f, field_in_world_ut, field_std_ut);
    let offset = |o: &FoundOffset| Ok(entry!(py, o, name, offset_ut, offset_std_ut, residual_ut, residual_without_ut));
    out.set_item("offsets", list(py, f.offsets.iter().map(offset))?)?;
    Ok(out)
}
