//! Python class `Config`: keyword arguments in, attributes out. The defaults are the engine's.

use crate::array::Any;
use crate::errors::{raise, DataError};
use oarlock::Config;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value};

/// A value as JSON text; arrays become lists, and numbers must be finite.
fn as_json(value: &Any<'_>) -> PyResult<String> {
    let py = value.py();
    let options = PyDict::new(py);
    options.set_item("default", py.import("operator")?.call_method1("methodcaller", ("tolist",))?)?;
    options.set_item("allow_nan", false)?;
    py.import("json")?.call_method("dumps", (value,), Some(&options))?.extract()
}

fn in_python_words(text: &str) -> String {
    text.replace("a boolean", "True or False").replace("a sequence", "a list").replace("f64", "a number")
}

/// Message for a value that an earlier version accepted.
fn removed(key: &str, value: &Value) -> Option<&'static str> {
    let is_iterated = key == "filter" && value.as_str() == Some("iekf");
    is_iterated.then_some("this filter was removed; the linearised filter is filter = \"ekf\"")
}

/// Settings of the filter by keyword.
#[pyclass(frozen, name = "Config", module = "oarlock")]
#[derive(Clone)]
pub struct PyConfig(pub Config);

#[pymethods]
impl PyConfig {
    #[new]
    #[pyo3(signature = (**keys))]
    fn new(py: Python<'_>, keys: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut all = Map::new();
        for (key, value) in keys.into_iter().flatten() {
            let wrong = |why: String| DataError::new_err(format!("config: {key} = {value:?}: {why}"));
            let json =
                as_json(&value).map_err(|e| wrong(format!("{e}; expected finite numbers, texts or lists of them")))?;
            let value: Value = serde_json::from_str(&json).map_err(|e| wrong(e.to_string()))?;
            let name = key.extract::<String>()?;
            if let Some(why) = removed(&name, &value) {
                return Err(wrong(why.into()));
            }
            let one = Map::from_iter([(name, value)]);
            let alone = serde_json::from_value::<Config>(Value::Object(one.clone()));
            alone.map_err(|e| wrong(in_python_words(&e.to_string())))?;
            all.extend(one);
        }
        let config: Config =
            serde_json::from_value(Value::Object(all)).map_err(|e| DataError::new_err(format!("config: {e}")))?;
        config.check().map_err(|e| raise(py, e))?;
        Ok(PyConfig(config))
    }

    /// All keys and values.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Any<'py>> {
        let json = serde_json::to_string(&self.0).map_err(|e| DataError::new_err(e.to_string()))?;
        py.import("json")?.call_method1("loads", (json,))
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Any<'py>> {
        let value = self.to_dict(py)?.get_item(name);
        value.map_err(|_| pyo3::exceptions::PyAttributeError::new_err(format!("Config has no key '{name}'")))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("Config(**{})", self.to_dict(py)?.repr()?))
    }

    fn __eq__(&self, other: &Any<'_>) -> bool {
        other.cast::<PyConfig>().is_ok_and(|o| o.get().0 == self.0)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Any<'py>, (Any<'py>,))> {
        let py = slf.py();
        let make = py.import("oarlock")?.getattr("_config_from_dict")?;
        Ok((make, (slf.get().to_dict(py)?,)))
    }
}
