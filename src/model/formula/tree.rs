//! A term as a tree: its dependences, its value, and the replacement of kinks.

/// The variables of a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variable {
    /// Angle, rad.
    Theta,
    /// Velocity.
    Velocity,
    /// Phase of the harmonic drive, rad.
    Phase,
    /// Time in the laboratory.
    Lab,
    /// Natural frequency.
    Frequency,
    /// The pivot's upward acceleration over gravity.
    Pivot,
    /// A parameter of the formula, by its place.
    Parameter(usize),
}

/// A function of one argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// Square root.
    Root,
    /// Exponential.
    Exponential,
    /// Natural logarithm.
    Logarithm,
    /// Sine of an angle in rad.
    Sine,
    /// Cosine of an angle in rad.
    Cosine,
    /// Hyperbolic tangent.
    Tanh,
    /// An angle less its whole turns, in [-pi, pi].
    Wrap,
    /// Absolute value.
    Abs,
    /// Sign: of the velocity, or of what does not change with the state.
    Sign,
}

/// An operation on two arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operator {
    /// Sum.
    Add,
    /// Difference.
    Subtract,
    /// Product.
    Multiply,
    /// Quotient.
    Divide,
    /// Power.
    Power,
}

/// A term.
#[derive(Clone, Debug, PartialEq)]
pub enum Tree {
    /// A number.
    Number(f64),
    /// A variable or parameter.
    Variable(Variable),
    /// A function of a tree.
    Apply(Function, Box<Self>),
    /// Two trees, joined.
    Join(Operator, Box<Self>, Box<Self>),
}

/// A point at which a term is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Angle, rad.
    pub theta: f64,
    /// Velocity.
    pub velocity: f64,
    /// The sign of the velocity, used if it is 0.
    pub sense: f64,
    /// Phase of the drive, rad.
    pub phase: f64,
    /// Time in the laboratory.
    pub lab: f64,
    /// Natural frequency.
    pub frequency: f64,
    /// The pivot's upward acceleration over gravity.
    pub pivot: f64,
}

impl Tree {
    /// Two trees, joined; numbers and what changes nothing are left out, so that `max(v, 0)` has the kink of
    /// `abs(v)`.
    pub fn join(operator: Operator, left: Self, right: Self) -> Self {
        use Operator::{Add, Divide, Multiply, Power, Subtract};
        match (operator, left, right) {
            (_, Self::Number(a), Self::Number(b)) => Self::Number(operator.of(a, b)),
            (Add, Self::Number(0.0), other)
            | (Add | Subtract, other, Self::Number(0.0))
            | (Multiply, Self::Number(1.0), other)
            | (Multiply | Divide | Power, other, Self::Number(1.0)) => other,
            (Multiply, Self::Number(0.0), _) | (Multiply, _, Self::Number(0.0)) => {
                Self::Number(0.0)
            }
            (Subtract, Self::Number(0.0), other) => other.negated(),
            (Power, base, Self::Number(0.5)) => Self::apply(Function::Root, base),
            (_, left, right) => Self::Join(operator, Box::new(left), Box::new(right)),
        }
    }

    /// The tree with the other sign.
    pub fn negated(self) -> Self {
        match self {
            Self::Number(value) => Self::Number(-value),
            other => Self::join(Operator::Multiply, Self::Number(-1.0), other),
        }
    }

    /// A function of a tree. Absolute values and signs of products are products of them, and the velocity is
    /// taken out of the sums that contain it, so that a kink at rest is one of `abs(v)` and any other argument is
    /// a further kink.
    pub fn apply(function: Function, inner: Self) -> Self {
        if function == Function::Root
            && let Some(rest) = inner.over_velocity().and_then(|once| once.over_velocity())
        {
            let speed = Self::apply(Function::Abs, Self::Variable(Variable::Velocity));
            return Self::join(Operator::Multiply, speed, Self::apply(function, rest));
        }
        if !matches!(function, Function::Abs | Function::Sign) {
            if let (Function::Root, Self::Number(value)) = (function, &inner) {
                return Self::Number(value.sqrt());
            }
            return Self::Apply(function, Box::new(inner));
        }
        match inner {
            Self::Number(value) => Self::Number(match function {
                Function::Abs => value.abs(),
                _ if value == 0.0 => 0.0,
                _ => value.signum(),
            }),
            Self::Join(operator @ (Operator::Multiply | Operator::Divide), left, right) => {
                Self::join(operator, Self::apply(function, *left), Self::apply(function, *right))
            }
            Self::Apply(Function::Abs, _) if function == Function::Abs => inner,
            Self::Join(Operator::Power, _, ref exponent)
                if function == Function::Abs && whole(exponent).is_some_and(|n| n % 2 == 0) =>
            {
                inner
            }
            Self::Apply(Function::Tanh, inner) if function == Function::Abs => {
                Self::apply(Function::Tanh, Self::apply(function, *inner))
            }
            Self::Apply(Function::Tanh, inner) => Self::apply(function, *inner),
            Self::Variable(_) => Self::Apply(function, Box::new(inner)),
            other => match other.over_velocity() {
                Some(factor) => Self::join(
                    Operator::Multiply,
                    Self::apply(function, factor),
                    Self::Apply(function, Box::new(Self::Variable(Variable::Velocity))),
                ),
                None => Self::Apply(function, Box::new(other)),
            },
        }
    }

    /// What it is the velocity times.
    fn over_velocity(&self) -> Option<Self> {
        use Operator::{Add, Divide, Multiply, Power, Subtract};
        match self {
            Self::Number(0.0) => Some(self.clone()),
            Self::Variable(Variable::Velocity) => Some(Self::Number(1.0)),
            Self::Join(operator @ (Add | Subtract), left, right) => {
                Some(Self::join(*operator, left.over_velocity()?, right.over_velocity()?))
            }
            Self::Join(Multiply, left, right) => match left.over_velocity() {
                Some(left) => Some(Self::join(Multiply, left, (**right).clone())),
                None => Some(Self::join(Multiply, (**left).clone(), right.over_velocity()?)),
            },
            Self::Join(Divide, left, right) => {
                Some(Self::join(Divide, left.over_velocity()?, (**right).clone()))
            }
            Self::Join(Power, base, exponent) => {
                let power = whole(exponent).filter(|power| *power >= 1)?;
                let rest = (**base).clone().raised(power - 1);
                Some(Self::join(Multiply, base.over_velocity()?, rest))
            }
            _ => None,
        }
    }

    fn raised(self, power: i32) -> Self {
        match power {
            0 => Self::Number(1.0),
            1 => self,
            _ => Self::join(Operator::Power, self, Self::Number(f64::from(power))),
        }
    }

    /// Whether it contains a name for which `is` holds.
    pub fn names(&self, is: fn(Variable) -> bool) -> bool {
        match self {
            Self::Number(_) => false,
            Self::Variable(variable) => is(*variable),
            Self::Apply(_, inner) => inner.names(is),
            Self::Join(_, left, right) => left.names(is) || right.names(is),
        }
    }

    /// Whether it changes with state or time.
    pub fn moves(&self) -> bool {
        self.names(|variable| !matches!(variable, Variable::Parameter(_) | Variable::Frequency))
    }

    /// Whether it contains the velocity other than as the whole argument of an absolute value or a
    /// sign.
    pub fn names_velocity_plainly(&self) -> bool {
        match self {
            Self::Number(_) => false,
            Self::Variable(_) => self.is_velocity(),
            Self::Apply(Function::Abs | Function::Sign, inner) if inner.is_velocity() => false,
            Self::Apply(_, inner) => inner.names_velocity_plainly(),
            Self::Join(_, left, right) => {
                left.names_velocity_plainly() || right.names_velocity_plainly()
            }
        }
    }

    /// How many numbers, names and functions it is made of.
    pub fn size(&self) -> usize {
        match self {
            Self::Number(_) | Self::Variable(_) => 1,
            Self::Apply(_, inner) => 1 + inner.size(),
            Self::Join(_, left, right) => 1 + left.size() + right.size(),
        }
    }

    /// Whether it is the velocity itself.
    pub fn is_velocity(&self) -> bool {
        *self == Self::Variable(Variable::Velocity)
    }

    /// Calls `visit` for every function in it.
    pub fn functions<'a>(&'a self, visit: &mut impl FnMut(Function, &'a Self)) {
        match self {
            Self::Number(_) | Self::Variable(_) => {}
            Self::Apply(function, inner) => {
                visit(*function, inner);
                inner.functions(visit);
            }
            Self::Join(_, left, right) => {
                left.functions(visit);
                right.functions(visit);
            }
        }
    }

    /// The arguments of its absolute values that change with state or time and are not the
    /// velocity: where they pass zero it has kinks.
    pub fn kinks(&self) -> Vec<&Self> {
        let mut found: Vec<&Self> = Vec::new();
        self.functions(&mut |function, inner| {
            let kink = function == Function::Abs && inner.moves() && !inner.is_velocity();
            if kink && !found.contains(&inner) {
                found.push(inner);
            }
        });
        found
    }

    /// Whether the velocity's absolute value stands where that has no derivative at rest: under a
    /// root, a logarithm, or a power that is not whole.
    pub fn has_steep_speed(&self) -> bool {
        self.steep(false)
    }

    fn steep(&self, steep: bool) -> bool {
        match self {
            Self::Number(_) | Self::Variable(_) => false,
            Self::Apply(Function::Abs, inner) => steep && inner.is_velocity(),
            Self::Apply(function, inner) => inner.steep(steep || function.is_steep()),
            Self::Join(operator, left, right) => {
                left.steep(steep || is_steep(*operator, right)) || right.steep(steep)
            }
        }
    }

    /// Its value, with absolute values and signs as they are; the parameters in their order.
    pub fn value(&self, parameters: &[f64], at: &Place) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Variable(variable) => match variable {
                Variable::Theta => at.theta,
                Variable::Velocity => at.velocity,
                Variable::Phase => at.phase,
                Variable::Lab => at.lab,
                Variable::Frequency => at.frequency,
                Variable::Pivot => at.pivot,
                Variable::Parameter(place) => parameters[*place],
            },
            Self::Apply(function, inner) => {
                let x = inner.value(parameters, at);
                match function {
                    Function::Root => x.sqrt(),
                    Function::Exponential => x.exp(),
                    Function::Logarithm => x.ln(),
                    Function::Sine => x.sin(),
                    Function::Cosine => x.cos(),
                    Function::Tanh => x.tanh(),
                    Function::Wrap => {
                        x - std::f64::consts::TAU * (x / std::f64::consts::TAU).round()
                    }
                    Function::Abs => x.abs(),
                    Function::Sign if x != 0.0 => x.signum(),
                    Function::Sign => at.sense,
                }
            }
            Self::Join(operator, left, right) => {
                operator.of(left.value(parameters, at), right.value(parameters, at))
            }
        }
    }
}

impl Operator {
    /// Its value.
    fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Power => a.powf(b),
        }
    }
}

impl Function {
    /// Whether it has no derivative where its argument is 0.
    pub const fn is_steep(self) -> bool {
        matches!(self, Self::Root | Self::Logarithm)
    }
}

/// Whether what is joined from the left has no derivative where that is 0.
pub fn is_steep(operator: Operator, right: &Tree) -> bool {
    operator == Operator::Power && whole(right).is_none()
}

/// The exponent, where it is a whole number of moderate size.
pub fn whole(exponent: &Tree) -> Option<i32> {
    match exponent {
        Tree::Number(value) if value.fract() == 0.0 && value.abs() <= 64.0 => Some(*value as i32),
        _ => None,
    }
}
