//! Input joints as states, for encoders that are not read at every sample.

use super::{Encoder, Model, Sensor, SensorKind};
use crate::error::{Error, Result};
use crate::model::suggest::hint;

impl Model {
    /// The model in which only the input joints in `kept` are inputs. Each of the others is a state that an encoder with
    /// the input's noise reads: that of the model file, or one with the joint's name.
    ///
    /// # Errors
    /// [`Error::Data`] for a name in `kept` that is no input joint.
    pub fn with_inputs(&self, kept: &[String]) -> Result<Model> {
        let inputs: Vec<&str> = self.joints.iter().filter(|j| j.input).map(|j| j.name.as_str()).collect();
        if let Some(odd) = kept.iter().find(|name| !inputs.contains(&name.as_str())) {
            return Err(Error::Data(format!(
                "config: inputs has '{odd}', which is no input joint of model '{}'; {}. Its input joints: {}",
                self.name,
                hint(odd, &inputs),
                inputs.join(", ")
            )));
        }
        let mut model = self.clone();
        for (j, joint) in model.joints.iter_mut().enumerate().filter(|(_, joint)| joint.input) {
            if kept.contains(&joint.name) {
                continue;
            }
            joint.input = false;
            let mut encoders = model.sensors.iter_mut().filter_map(|sensor| match &mut sensor.kind {
                SensorKind::Encoder(encoder) if encoder.joint == j => Some(encoder),
                _ => None,
            });
            match encoders.next() {
                Some(encoder) => encoder.std = joint.input_std,
                None => {
                    let kind = SensorKind::Encoder(Encoder { joint: j, std: joint.input_std });
                    model.sensors.push(Sensor { name: joint.name.clone(), kind });
                }
            }
        }
        Ok(model)
    }
}
