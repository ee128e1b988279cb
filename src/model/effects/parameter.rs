//! Parameters of effects: role, unit, scaling and ranges.

use crate::model::formula::ParameterSpec;

/// How a parameter scales: its value in SI units is the one without dimensions times a power of
/// `w0`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Power {
    /// `w0^k`.
    Of(i32),
    /// `w0^k` where `k` is not whole.
    Real(f64),
    /// `w0^(2 - n)` where `n` is the effect's parameter of that place.
    TwoMinus(usize),
}

/// The role of a parameter in its effect. A search depends on the role, never on a name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Strength of the effect: at 0 there is none.
    Size,
    /// Width, in angle or velocity.
    Width,
    /// The angle at which it acts, on either side of the rest.
    Place,
    /// An exponent.
    Power,
    /// Number of repetitions in a turn, an integer.
    Order,
    /// Duration or time constant.
    Time,
    /// An angle with any value within a turn.
    Phase,
    /// Frequency: records resolve differences of one cycle in their span.
    Frequency,
    /// Instant.
    Instant,
    /// The frequency of a mode of the rig, or its damping ratio.
    Mode,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Size,
        Self::Width,
        Self::Place,
        Self::Power,
        Self::Order,
        Self::Time,
        Self::Phase,
        Self::Frequency,
        Self::Instant,
        Self::Mode,
    ];

    /// The name of the role.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Size => "size",
            Self::Width => "width",
            Self::Place => "place",
            Self::Power => "power",
            Self::Order => "order",
            Self::Time => "time constant",
            Self::Phase => "phase",
            Self::Frequency => "frequency",
            Self::Instant => "instant",
            Self::Mode => "mode",
        }
    }
}

/// A parameter of an effect.
#[derive(Clone, Copy, Debug)]
pub struct Parameter<'a> {
    /// Its name in model files.
    pub name: &'a str,
    /// Its role.
    pub role: Role,
    /// Its unit in SI.
    pub unit: &'a str,
    /// How it scales with `w0`.
    pub power: Power,
    /// Bounds of meaningful values, without dimensions.
    pub range: [f64; 2],
    /// Typical range, in which a search begins.
    pub typical: [f64; 2],
    /// Its meaning, in words.
    pub meaning: &'a str,
}

/// The parameters of an effect, in order.
#[derive(Clone, Copy, Debug)]
pub enum Parameters<'a> {
    /// Parameters of an effect of the library.
    Library(&'static [Parameter<'static>]),
    /// Parameters of a formula.
    Formula(&'a [ParameterSpec]),
}

impl<'a> Parameters<'a> {
    /// Number of parameters.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Library(all) => all.len(),
            Self::Formula(all) => all.len(),
        }
    }

    /// The parameter at an index.
    ///
    /// # Panics
    /// If there is no such index.
    #[must_use]
    pub fn at(self, place: usize) -> Parameter<'a> {
        match self {
            Self::Library(all) => all[place],
            Self::Formula(all) => all[place].parameter(),
        }
    }

    /// All of them.
    pub fn iter(self) -> impl Iterator<Item = Parameter<'a>> {
        (0..self.count()).map(move |place| self.at(place))
    }
}
