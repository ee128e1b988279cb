//! States of many trajectories as columns, which the stroboscopic map advances.

use crate::error::Error;

/// Angle and velocity, `[theta, th']`.
pub type State = [f64; 2];

/// The states of many trajectories and the whole turns of each: columns of one length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct States {
    pub(super) theta: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) turns: Vec<f64>,
}

impl States {
    /// The states of these angles and velocities, without turns.
    ///
    /// # Errors
    /// [`Error::Lengths`] if they differ in number.
    pub fn new(theta: Vec<f64>, velocity: Vec<f64>) -> Result<Self, Error> {
        if theta.len() != velocity.len() {
            let given = (theta.len(), velocity.len());
            return Err(Error::Lengths { given, names: ("theta", "velocity") });
        }
        let turns = vec![0.0; theta.len()];
        Ok(Self { theta, velocity, turns })
    }

    /// Number of trajectories.
    #[must_use]
    pub fn len(&self) -> usize {
        self.theta.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.theta.is_empty()
    }

    /// The angles.
    #[must_use]
    pub fn theta(&self) -> &[f64] {
        &self.theta
    }

    /// The velocities.
    #[must_use]
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// The whole turns that were removed from the angles.
    #[must_use]
    pub fn turns(&self) -> &[f64] {
        &self.turns
    }

    /// State number `index`.
    #[must_use]
    pub fn get(&self, index: usize) -> State {
        [self.theta[index], self.velocity[index]]
    }

    /// Adds the states of `others` at the end.
    pub fn append(&mut self, mut others: Self) {
        self.theta.append(&mut others.theta);
        self.velocity.append(&mut others.velocity);
        self.turns.append(&mut others.turns);
    }

    /// All states in their order.
    #[must_use]
    pub fn iter(&self) -> impl ExactSizeIterator<Item = State> + '_ {
        self.theta.iter().zip(&self.velocity).map(|(theta, velocity)| [*theta, *velocity])
    }

    /// All states as a list.
    #[must_use]
    pub fn to_vec(&self) -> Vec<State> {
        self.iter().collect()
    }
}

impl FromIterator<State> for States {
    fn from_iter<T: IntoIterator<Item = State>>(states: T) -> Self {
        let (theta, velocity): (Vec<f64>, Vec<f64>) =
            states.into_iter().map(|[theta, velocity]| (theta, velocity)).unzip();
        let turns = vec![0.0; theta.len()];
        Self { theta, velocity, turns }
    }
}

impl From<&[State]> for States {
    fn from(states: &[State]) -> Self {
        states.iter().copied().collect()
    }
}

/// States with a tangent vector each, and the growth of these vectors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TangentStates {
    pub(super) states: States,
    /// Components of the vectors along angle and velocity.
    pub(super) tangents: [Vec<f64>; 2],
    pub(super) growth: Vec<f64>,
}

impl TangentStates {
    /// These states, all with the vector `tangent`.
    #[must_use]
    pub fn along(states: &[State], tangent: State) -> Self {
        states.iter().map(|state| (*state, tangent)).collect()
    }

    /// The states.
    #[must_use]
    pub fn states(&self) -> &States {
        &self.states
    }

    /// The vector of state number `index`.
    #[must_use]
    pub fn tangent(&self, index: usize) -> State {
        [self.tangents[0][index], self.tangents[1][index]]
    }

    /// The natural logarithm of the growth of each vector.
    #[must_use]
    pub fn growth(&self) -> &[f64] {
        &self.growth
    }

    /// Measures growth from now on.
    pub fn reset_growth(&mut self) {
        self.growth.fill(0.0);
    }
}

impl FromIterator<(State, State)> for TangentStates {
    /// States, each with its vector.
    fn from_iter<T: IntoIterator<Item = (State, State)>>(pairs: T) -> Self {
        let (states, tangents): (Vec<State>, Vec<State>) = pairs.into_iter().unzip();
        Self {
            growth: vec![0.0; states.len()],
            states: states.into_iter().collect(),
            tangents: [0, 1].map(|part| tangents.iter().map(|vector| vector[part]).collect()),
        }
    }
}
