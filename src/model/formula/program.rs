//! A tree as a list of operations over numbers of any kind.
//!
//! One operation works on a whole bundle of lanes, so that looking up which one it is costs a small
//! part of doing it. Equal parts are computed once; what takes most intermediate values comes first
//! (Sethi & Ullman 1970, Journal of the ACM 17, 715), so that few suffice.

use std::f64::consts::{FRAC_1_PI, PI};

use super::tree::{Function, Operator, Tree, Variable, is_steep, whole};
use crate::lanes::sine::Fine;
use crate::lanes::{Real, Work};
use crate::model::effects::{MOST_PARAMETERS, Point};

/// Intermediate values at one time.
pub const SLOTS: usize = 8;

/// Under a root, a logarithm or a power that is not whole, `|x|` is `sqrt(x^2 + FLOOR)`: so
/// derivatives are finite where `x` is 0, as for the power laws of the library.
const FLOOR: f64 = 1e-12;

/// Treatment of absolute values and signs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kinks<'a> {
    /// The argument whose sign is [`Point::side`]; others are evaluated at each point.
    pub corner: Option<&'a Tree>,
    /// Whether the sign of the velocity passes steeply, not abruptly, through zero: where its jump
    /// at rest is nothing.
    pub steep_sign: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Operation {
    Add,
    Subtract,
    Multiply,
    Divide,
    /// `x * factor + addend`.
    Affine(f64, f64),
    /// A number over `x`.
    Over(f64),
    /// A whole power above 1.
    Whole(i32),
    Root,
    Exponential,
    Logarithm,
    Sine,
    Cosine,
    Tanh,
    Wrap,
    Magnitude,
    Floored,
    Sign,
}

/// Location of an operand.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Source {
    Theta,
    Velocity,
    Sense,
    Side,
    Phase,
    Lab,
    Vertical,
    PerGravity,
    Parameter(usize),
    /// The result of another operation.
    Slot(usize),
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    operation: Operation,
    first: Source,
    second: Source,
    to: usize,
}

/// The operations, in order.
#[derive(Clone, Debug)]
pub struct Program {
    steps: Vec<Step>,
    result: usize,
}

impl Program {
    /// The program of a tree; none if it needs more than [`SLOTS`] intermediate values.
    pub fn new(tree: &Tree, kinks: Kinks<'_>) -> Option<Self> {
        let build = |shares: bool| {
            let mut builder = Builder { kinks, steps: Vec::new(), shares };
            let value = builder.tree(tree, false);
            let result = builder.stored(value);
            builder.allocated(result)
        };
        build(true).or_else(|| build(false))
    }

    /// The value of the term.
    ///
    /// Aside, and on a copy: operands are looked up in memory there, where the other effects would
    /// else have to keep theirs too.
    #[inline(always)]
    pub fn run<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        // Values that no operation takes are not copied.
        let at = Point { sine: at.theta, ..*at };
        let mut value = at.theta;
        at.theta.aside(Running { program: self, parameters, at: &at, value: &mut value });
        value
    }
}

/// A program under construction.
struct Running<'a, R> {
    program: &'a Program,
    parameters: &'a [R; MOST_PARAMETERS],
    at: &'a Point<R>,
    value: &'a mut R,
}

impl<R: Real> Work for Running<'_, R> {
    #[inline(always)]
    fn run(self) {
        let Self { program, parameters, at, value } = self;
        let mut slots = [at.theta; SLOTS];
        for Step { operation, first, second, to } in &program.steps {
            macro_rules! operand {
                ($source:expr) => {
                    match $source {
                        Source::Theta => &at.theta,
                        Source::Velocity => &at.velocity,
                        Source::Sense => &at.sense,
                        Source::Side => &at.side,
                        Source::Phase => &at.phase,
                        Source::Lab => &at.lab,
                        Source::Vertical => &at.vertical,
                        Source::PerGravity => &at.per_gravity,
                        Source::Parameter(place) => &parameters[*place % MOST_PARAMETERS],
                        Source::Slot(place) => &slots[*place % SLOTS],
                    }
                };
            }
            let x = *operand!(first);
            let result = match operation {
                Operation::Add => x + *operand!(second),
                Operation::Subtract => x - *operand!(second),
                Operation::Multiply => x * *operand!(second),
                Operation::Divide => x / *operand!(second),
                Operation::Affine(factor, addend) => x.affine(*factor, *addend),
                Operation::Over(number) => x.like(*number) / x,
                Operation::Whole(power) => whole_power(x, *power),
                Operation::Root => x.root(),
                // A NaN stays a NaN: the functions of the lanes would clamp it to their range.
                Operation::Exponential => x.exponential() + x.scale(0.0),
                Operation::Logarithm => x.logarithm() + x.root().scale(0.0),
                Operation::Sine => x.scale(FRAC_1_PI).sine::<Fine>(),
                Operation::Cosine => x.scale(FRAC_1_PI).cosine::<Fine>(),
                Operation::Tanh => {
                    let sign = x.sign();
                    let growth = (x * sign).scale(2.0).exponential();
                    let rest = x.like(2.0) / (growth + x.like(1.0));
                    (x.like(1.0) - rest) * sign
                }
                Operation::Wrap => x.scale(FRAC_1_PI).wrapped().scale(PI),
                Operation::Magnitude => x * x.sign(),
                Operation::Floored => x.mul_add(x, x.like(FLOOR)).root(),
                Operation::Sign => x.sign(),
            };
            slots[*to % SLOTS] = result;
        }
        *value = slots[program.result % SLOTS];
    }
}

/// `x^power` for a power above 1.
#[inline(always)]
fn whole_power<R: Real>(x: R, power: i32) -> R {
    let mut rest = power - 1;
    let (mut square, mut product) = (x, x);
    while rest > 0 {
        if rest & 1 == 1 {
            product = product * square;
        }
        rest >>= 1;
        if rest > 0 {
            square = square * square;
        }
    }
    product
}

/// A number, or its location.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Value {
    Number(f64),
    At(Source),
}

struct Builder<'a> {
    kinks: Kinks<'a>,
    /// With the place of each result among all of them in place of its slot.
    steps: Vec<Step>,
    /// Whether equal parts are computed once.
    shares: bool,
}

impl Builder<'_> {
    fn push(&mut self, operation: Operation, first: Source, second: Source) -> Value {
        let known = |step: &Step| {
            step.operation == operation && step.first == first && step.second == second
        };
        if self.shares
            && let Some(place) = self.steps.iter().position(known)
        {
            return Value::At(Source::Slot(place));
        }
        self.steps.push(Step { operation, first, second, to: self.steps.len() });
        Value::At(Source::Slot(self.steps.len() - 1))
    }

    fn unary(&mut self, operation: Operation, of: Source) -> Value {
        self.push(operation, of, of)
    }

    #[allow(clippy::float_cmp)] // exactly those numbers that change nothing
    fn affine(&mut self, of: Source, factor: f64, addend: f64) -> Value {
        if factor == 1.0 && addend == 0.0 {
            return Value::At(of);
        }
        if let Source::Slot(place) = of
            && let Step { operation: Operation::Affine(inner, rest), first, .. } = self.steps[place]
            && (rest == 0.0 || factor == 1.0)
        {
            return self.affine_of(first, inner * factor, rest * factor + addend);
        }
        self.affine_of(of, factor, addend)
    }

    fn affine_of(&mut self, of: Source, factor: f64, addend: f64) -> Value {
        self.unary(Operation::Affine(factor, addend), of)
    }

    /// The place where a value is, by another operation if needed.
    fn stored(&mut self, value: Value) -> usize {
        let stored = match value {
            Value::At(Source::Slot(place)) => return place,
            Value::At(source) => self.affine_of(source, 1.0, 0.0),
            Value::Number(number) => self.affine_of(Source::Theta, 0.0, number),
        };
        match stored {
            Value::At(Source::Slot(place)) => place,
            _ => 0,
        }
    }

    /// `steep`: whether it stands where an absolute value needs a floor.
    fn tree(&mut self, tree: &Tree, steep: bool) -> Value {
        match tree {
            Tree::Number(value) => Value::Number(*value),
            Tree::Variable(variable) => self.variable(*variable),
            Tree::Apply(function @ (Function::Abs | Function::Sign), inner) => {
                self.kink(*function, inner, steep)
            }
            Tree::Apply(function, inner) => {
                let value = self.tree(inner, steep || function.is_steep());
                self.function(*function, value)
            }
            Tree::Join(Operator::Power, base, exponent) => self.power(base, exponent, steep),
            Tree::Join(operator, left, right) => {
                let (a, b) = if need(left) >= need(right) {
                    let a = self.tree(left, steep);
                    (a, self.tree(right, steep))
                } else {
                    let b = self.tree(right, steep);
                    (self.tree(left, steep), b)
                };
                self.joined(*operator, a, b)
            }
        }
    }

    fn variable(&mut self, variable: Variable) -> Value {
        Value::At(match variable {
            Variable::Theta => Source::Theta,
            Variable::Velocity => Source::Velocity,
            Variable::Phase => Source::Phase,
            Variable::Lab => Source::Lab,
            Variable::Parameter(place) => Source::Parameter(place),
            Variable::Pivot => {
                let product = self.push(Operation::Multiply, Source::Vertical, Source::PerGravity);
                return self.joined(Operator::Subtract, product, Value::Number(1.0));
            }
            Variable::Frequency => {
                let root = self.unary(Operation::Root, Source::PerGravity);
                return self.joined(Operator::Divide, Value::Number(1.0), root);
            }
        })
    }

    fn kink(&mut self, function: Function, inner: &Tree, steep: bool) -> Value {
        let value = self.tree(inner, steep);
        let x = match (value, function) {
            (Value::Number(x), Function::Abs) => return Value::Number(x.abs()),
            (Value::Number(x), _) => return Value::Number(x.signum()),
            (Value::At(x), _) => x,
        };
        if function == Function::Sign {
            return match (inner.is_velocity(), self.kinks.steep_sign) {
                (true, true) => {
                    let floored = self.unary(Operation::Floored, x);
                    self.joined(Operator::Divide, value, floored)
                }
                (true, false) => Value::At(Source::Sense),
                (false, _) => self.unary(Operation::Sign, x),
            };
        }
        if steep && inner.moves() {
            return self.unary(Operation::Floored, x);
        }
        if inner.is_velocity() {
            return self.push(Operation::Multiply, x, Source::Sense);
        }
        if self.kinks.corner == Some(inner) {
            return self.push(Operation::Multiply, x, Source::Side);
        }
        self.unary(Operation::Magnitude, x)
    }

    fn function(&mut self, function: Function, of: Value) -> Value {
        let x = match of {
            Value::Number(x) => {
                let tree = Tree::apply(function, Tree::Number(x));
                return Value::Number(tree.value(&[], &super::probe::NOWHERE));
            }
            Value::At(x) => x,
        };
        let operation = match function {
            Function::Root => Operation::Root,
            Function::Exponential => Operation::Exponential,
            Function::Logarithm => Operation::Logarithm,
            Function::Sine => Operation::Sine,
            Function::Cosine => Operation::Cosine,
            Function::Tanh => Operation::Tanh,
            Function::Wrap => Operation::Wrap,
            Function::Abs => Operation::Magnitude,
            Function::Sign => Operation::Sign,
        };
        self.unary(operation, x)
    }

    fn joined(&mut self, operator: Operator, a: Value, b: Value) -> Value {
        match (operator, a, b) {
            (_, Value::Number(a), Value::Number(b)) => Value::Number(match operator {
                Operator::Add => a + b,
                Operator::Subtract => a - b,
                Operator::Multiply => a * b,
                Operator::Divide => a / b,
                Operator::Power => a.powf(b),
            }),
            (Operator::Add, Value::At(x), Value::Number(c))
            | (Operator::Add, Value::Number(c), Value::At(x)) => self.affine(x, 1.0, c),
            (Operator::Subtract, Value::At(x), Value::Number(c)) => self.affine(x, 1.0, -c),
            (Operator::Subtract, Value::Number(c), Value::At(x)) => self.affine(x, -1.0, c),
            (Operator::Multiply, Value::At(x), Value::Number(c))
            | (Operator::Multiply, Value::Number(c), Value::At(x)) => self.affine(x, c, 0.0),
            (Operator::Divide, Value::At(x), Value::Number(c)) => self.affine(x, 1.0 / c, 0.0),
            (Operator::Divide, Value::Number(c), Value::At(x)) => self.unary(Operation::Over(c), x),
            (Operator::Add, Value::At(a), Value::At(b)) => self.push(Operation::Add, a, b),
            (Operator::Subtract, Value::At(a), Value::At(b)) => {
                self.push(Operation::Subtract, a, b)
            }
            (Operator::Multiply, Value::At(a), Value::At(b)) => {
                self.push(Operation::Multiply, a, b)
            }
            (Operator::Divide, Value::At(a), Value::At(b)) => self.push(Operation::Divide, a, b),
            (Operator::Power, a, b) => {
                let logarithm = self.function(Function::Logarithm, a);
                let product = self.joined(Operator::Multiply, b, logarithm);
                self.function(Function::Exponential, product)
            }
        }
    }

    fn power(&mut self, base: &Tree, exponent: &Tree, steep: bool) -> Value {
        let under = steep || is_steep(Operator::Power, exponent);
        let of = self.tree(base, under);
        if let (Value::At(x), Some(power)) = (of, whole(exponent)) {
            let size = match power.abs() {
                0 => return Value::Number(1.0),
                1 => of,
                size => self.unary(Operation::Whole(size), x),
            };
            if power > 0 {
                return size;
            }
            return self.joined(Operator::Divide, Value::Number(1.0), size);
        }
        if *exponent == Tree::Number(0.5) {
            return self.function(Function::Root, of);
        }
        let exponent = self.tree(exponent, steep);
        self.joined(Operator::Power, of, exponent)
    }

    /// The program, with each result in a slot that is free from then on.
    fn allocated(self, result: usize) -> Option<Program> {
        let steps = &self.steps;
        // From the last one back: unused results are left out.
        let mut last_use = vec![0; steps.len()];
        last_use[result] = steps.len();
        for (k, step) in steps.iter().enumerate().rev() {
            for source in [step.first, step.second] {
                if let Source::Slot(place) = source
                    && last_use[k] > 0
                {
                    last_use[place] = last_use[place].max(k);
                }
            }
        }
        let mut slot_of = vec![0; steps.len()];
        let mut holds: [Option<usize>; SLOTS] = [None; SLOTS];
        let mut program = Vec::with_capacity(steps.len());
        for (k, step) in steps.iter().enumerate().filter(|(k, _)| last_use[*k] > 0) {
            let source = |source: Source| match source {
                Source::Slot(place) => Source::Slot(slot_of[place]),
                other => other,
            };
            let (first, second) = (source(step.first), source(step.second));
            // An operand that ends here may make room for the result.
            let free = |held: &Option<usize>| held.is_none_or(|place| last_use[place] <= k);
            let to = holds.iter().position(free)?;
            holds[to] = Some(k);
            slot_of[k] = to;
            program.push(Step { operation: step.operation, first, second, to });
        }
        Some(Program { steps: program, result: slot_of[result] })
    }
}

/// Number of intermediate values of a tree.
fn need(tree: &Tree) -> usize {
    match tree {
        Tree::Number(_) | Tree::Variable(_) => 0,
        Tree::Apply(_, inner) => need(inner).max(1),
        Tree::Join(_, left, right) => {
            let (a, b) = (need(left), need(right));
            if a == b { a + 1 } else { a.max(b) }
        }
    }
}
