//! Records, and which parameters of their pendulums are free.

use super::record::{Record, range};
use super::rod_sensor::RodSensor;
use super::step_scale::StepScale;
use crate::error::Error;
use crate::integrate::reference::problem::greatest_rate;
use crate::lanes::InstructionSet;
use crate::model::effects::Action;
use crate::model::{Parameter, Pendulum};

/// Largest number of free parameters of a record's reading.
pub const MOST_READINGS: usize = 7;

/// A position for a number in a pendulum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// `(w0 / w_ref)^2`.
    Gravity,
    /// A parameter of the pendulum.
    Parameter(Parameter),
    /// [`RodSensor::bias`].
    Bias,
}

/// A free parameter.
#[derive(Clone, Debug)]
pub struct Free {
    /// Its records and its place in each; one number for all of them, at most once in each.
    pub places: Vec<(usize, Slot)>,
    /// Its starting value.
    pub start: f64,
}

impl Free {
    /// The range of its values: that of the parameter of an effect, otherwise unbounded.
    fn range(&self, records: &[Record]) -> [f64; 2] {
        let of_effect = |(record, slot): &(usize, Slot)| {
            let Slot::Parameter(Parameter::OfEffect { effect, place }) = *slot else { return None };
            let effects = &records[*record].pendulum.effects;
            Some(effects[effect].kind.definition().parameters.at(place).range)
        };
        self.places.first().and_then(of_effect).unwrap_or([f64::NEG_INFINITY, f64::INFINITY])
    }

    /// Its place in record `index`.
    fn slot(&self, index: usize) -> Option<Slot> {
        self.places.iter().find(|(record, _)| *record == index).map(|(_, slot)| *slot)
    }
}

/// Records and free parameters.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The records.
    pub records: Vec<Record>,
    /// The free parameters.
    pub free: Vec<Free>,
    /// Scale of the steps of each.
    pub scales: Vec<StepScale>,
    /// Bounds of each.
    pub ranges: Vec<[f64; 2]>,
    /// Error tolerance of a step of the integrator.
    pub tolerance: f64,
    /// The instruction set that derivatives are computed with.
    pub simd: InstructionSet,
}

/// A record's pendulum with values for the free parameters.
#[derive(Clone, Debug)]
pub struct Shaped {
    /// The pendulum.
    pub pendulum: Pendulum,
    /// `(w0 / w_ref)^2`.
    pub gravity: f64,
    /// The record's sensor on the rod.
    pub rod_sensor: Option<RodSensor>,
    /// [`greatest_rate`] of the pendulum, equal for all windows.
    pub rate: f64,
}

/// The free parameters of one record: their indices in [`Problem::free`], and their places.
#[derive(Clone, Debug, Default)]
pub struct Columns {
    /// Parameters on which the motion depends.
    pub motion: Vec<(usize, Slot)>,
    /// Parameters on which only the reading depends.
    pub reading: Vec<(usize, Parameter)>,
}

impl Columns {
    /// How many there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.motion.len() + self.reading.len()
    }

    /// Their places in [`Problem::free`], those of the motion first.
    pub fn places(&self) -> impl Iterator<Item = usize> + '_ {
        self.motion.iter().map(|(place, _)| *place).chain(self.reading.iter().map(|(p, _)| *p))
    }
}

impl Problem {
    /// Checks lengths, times, numbers and places.
    ///
    /// # Errors
    /// [`Error::Lengths`] where a record's arrays differ in length, [`Error::Range`] for a number
    /// that is not finite, a time that is not after the one before it, a negative weight, a record
    /// with fewer than 3 trusted samples; [`Error::NoParameter`] for a free parameter that its pendulum
    /// does not have; [`Error::Simd`], see [`InstructionSet::choose`].
    pub fn new(records: Vec<Record>, free: Vec<Free>, tolerance: f64) -> Result<Self, Error> {
        for record in &records {
            record.check()?;
        }
        for Free { places, start } in &free {
            if !start.is_finite() {
                return Err(range("start of a free parameter", *start, "a finite number"));
            }
            for (record, slot) in places {
                let index = *record as f64;
                let Some(record) = records.get(*record) else {
                    let allowed = "one of those given";
                    return Err(range("record of a free parameter", index, allowed));
                };
                if *slot == Slot::Bias && record.rod_sensor.is_none() {
                    let allowed = "one with a gyroscope";
                    return Err(range("record of a bias", index, allowed));
                }
                if let Slot::Parameter(parameter) = *slot
                    && !record.pendulum.has(parameter)
                {
                    return Err(Error::NoParameter { name: format!("{parameter:?}") });
                }
            }
        }
        let scales = free.iter().map(|one| StepScale::of(one, &free, &records)).collect();
        let ranges = free.iter().map(|one| one.range(&records)).collect();
        let problem =
            Self { records, free, scales, ranges, tolerance, simd: InstructionSet::choose()? };
        for index in 0..problem.records.len() {
            let count = problem.columns(index).reading.len();
            if count > MOST_READINGS {
                return Err(range(
                    "number of free parameters of the reading",
                    count as f64,
                    "7 or fewer",
                ));
            }
        }
        if !(tolerance > 0.0 && tolerance.is_finite()) {
            return Err(range("tolerance", tolerance, "a number above 0"));
        }
        Ok(problem)
    }

    /// The values from which the search starts.
    #[must_use]
    pub fn start(&self) -> Vec<f64> {
        self.free.iter().map(|free| free.start).collect()
    }

    /// The free parameters of record `index`.
    #[must_use]
    pub fn columns(&self, index: usize) -> Columns {
        let pendulum = &self.records[index].pendulum;
        let reads = |parameter: Parameter| match parameter {
            Parameter::OfEffect { effect, .. } => pendulum.effects[effect].is(&[Action::Reading]),
            _ => false,
        };
        let mut columns = Columns::default();
        for (place, free) in self.free.iter().enumerate() {
            match free.slot(index) {
                Some(Slot::Parameter(parameter)) if reads(parameter) => {
                    columns.reading.push((place, parameter));
                }
                Some(slot) => columns.motion.push((place, slot)),
                None => {}
            }
        }
        columns
    }

    /// The pendulum of record `index` with `values` for the free parameters; none where one is
    /// outside the range in which its formula means something. Negative damping and friction are
    /// allowed: what is missing in a model may drive them there.
    #[must_use]
    pub fn shaped(&self, index: usize, values: &[f64]) -> Option<Shaped> {
        let Record { pendulum, rod_sensor, .. } = &self.records[index];
        let (pendulum, rod_sensor) = (pendulum.clone(), *rod_sensor);
        let mut shaped = Shaped { pendulum, gravity: 1.0, rod_sensor, rate: 1.0 };
        for (free, value) in self.free.iter().zip(values) {
            match free.slot(index) {
                Some(Slot::Gravity) => shaped.gravity = *value,
                Some(Slot::Parameter(parameter)) => shaped.pendulum.set(parameter, *value),
                Some(Slot::Bias) => {
                    if let Some(sensor) = &mut shaped.rod_sensor {
                        sensor.bias = *value;
                    }
                }
                None => {}
            }
        }
        shaped.is_sound().then(|| Shaped { rate: greatest_rate(&shaped.pendulum), ..shaped })
    }

    /// Number of samples with nonzero weight.
    #[must_use]
    pub fn samples(&self) -> usize {
        let trusted = |record: &Record| record.weights.iter().filter(|w| **w > 0.0).count();
        self.records.iter().map(trusted).sum()
    }
}

impl Shaped {
    fn is_sound(&self) -> bool {
        let parameters = self.pendulum.parameters().into_iter();
        let finite = parameters.map(|one| self.pendulum.value(one)).all(f64::is_finite);
        let in_range = self.pendulum.effects.iter().all(|effect| {
            let parameters = effect.kind.definition().parameters;
            parameters
                .iter()
                .zip(effect.values())
                .all(|(parameter, value)| (parameter.range[0]..=parameter.range[1]).contains(value))
        });
        let read = self.rod_sensor.is_none_or(|sensor| sensor.is_sound());
        finite && in_range && read && self.pendulum.motion().omega > 0.0 && self.gravity > 0.0
    }
}
