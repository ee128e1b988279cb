//! An effect defined by its user as a formula: a torque per inertia as text.
//!
//! - `check`: names and terms that are refused
//! - `parse`: from text to a `tree`
//! - `probe`: properties of the term, by its values
//! - `program`: the tree as operations over lanes, single numbers and numbers with derivatives
//!
//! A term that jumps where the velocity passes zero is dry friction: of `T`, held at either sense of
//! the motion, `-(T(+) - T(-))/2` is the friction and `(T(+) + T(-))/2` a torque. So it sticks and
//! slips as exactly as the library's. Where the argument of one absolute value passes zero steps end
//! ([`Law::switch`](super::effects::Law::switch)); more kinks than one are stepped over.

mod check;
mod parse;
mod probe;
mod program;
mod tree;

use std::collections::VecDeque;
use std::f64::consts::PI;
use std::sync::{Arc, Mutex, PoisonError};

use self::program::{Kinks, Program, SLOTS};
use self::tree::{Function, Tree, Variable};
use super::effects::law::NOT_PERIODIC;
use super::effects::{
    Action, Definition, Family, Group, MOST_PARAMETERS, Mappable, Parameter, Parameters, Point,
    Power, Role,
};
use crate::error::Error;
use crate::lanes::Real;

/// Reason for which a map cannot have a torque that differs between periods.
const NOT_IN_STEP: &str =
    "it does not repeat every period of the drive, and a map takes whole periods";

/// A formula as given by its user.
#[derive(Clone, Debug, PartialEq)]
pub struct Spec {
    /// Its name.
    pub name: String,
    /// The torque per inertia, over `theta`, `v`, `phase`, `t`, `w0`, `a` and the parameters.
    pub term: String,
    /// Data that show it; if not given, they follow from the term.
    pub revealed_by: String,
    /// The parameters, in order.
    pub parameters: Vec<ParameterSpec>,
}

/// A parameter of a formula as given by its user.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSpec {
    /// Its name.
    pub name: String,
    /// Its power of `w0`.
    pub power: f64,
    /// The index of the parameter whose value is subtracted from the power.
    pub less: Option<usize>,
    /// Its unit in SI.
    pub unit: String,
    /// The least and the greatest value allowed, without dimensions.
    pub range: [f64; 2],
    /// The smallest and the largest value of interest, without dimensions.
    pub typical: [f64; 2],
    /// Its meaning, in words.
    pub meaning: String,
    /// Its role; by default inferred from the term.
    pub role: Option<Role>,
}

/// A formula that is ready to run.
#[derive(Debug)]
pub struct Formula {
    /// The text of the user, with the role of every parameter.
    spec: Spec,
    group: Group,
    action: Action,
    mappable: Mappable,
    tree: Tree,
    program: Program,
    switch: Option<Program>,
    /// The version that steps over its corner, for a model in which another effect has one.
    loose: Option<Arc<Self>>,
    timed: bool,
    driven: bool,
}

/// Number of formulas in the cache.
const MOST_RECENT: usize = 64;

/// The most recent formulas: a repeated model is not checked again.
static RECENT: Mutex<VecDeque<(Spec, Arc<Formula>)>> = Mutex::new(VecDeque::new());

impl PartialEq for Formula {
    fn eq(&self, other: &Self) -> bool {
        self.spec == other.spec && self.switch.is_some() == other.switch.is_some()
    }
}

impl Eq for Formula {}

impl Formula {
    /// Reads and checks a formula.
    ///
    /// # Errors
    /// [`Error::Formula`] for a name that is taken, a term that cannot be read, units that do not
    /// balance, a jump elsewhere than where the velocity passes zero, or a value that is no number.
    pub fn new(spec: &Spec) -> Result<Arc<Self>, Error> {
        let mut recent = RECENT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, formula)) = recent.iter().find(|(known, _)| known == spec) {
            return Ok(formula.clone());
        }
        let formula =
            Self::made(spec).map_err(|why| Error::Formula { name: spec.name.clone(), why })?;
        recent.truncate(MOST_RECENT - 1);
        recent.push_front((spec.clone(), formula.clone()));
        Ok(formula)
    }

    fn made(spec: &Spec) -> Result<Arc<Self>, String> {
        check::names(spec)?;
        let names: Vec<String> = spec.parameters.iter().map(|p| p.name.clone()).collect();
        let tree = parse::parse(&spec.term, &names)?;
        let mut parameters: Vec<Parameter> =
            spec.parameters.iter().map(ParameterSpec::parameter).collect();
        check::term(&tree, &parameters)?;
        for (place, said) in spec.parameters.iter().enumerate() {
            parameters[place].role =
                said.role.unwrap_or_else(|| probe::role(&tree, &parameters, place));
        }
        let roles: Vec<Role> = parameters.iter().map(|parameter| parameter.role).collect();
        let jumps = probe::jumps(&tree, &parameters);
        let steep_sign = !jumps && tree.has_steep_speed();
        let kinks = tree.kinks();
        let corner = if kinks.len() == 1 { Some(kinks[0]) } else { None };
        let compiled = |tree: &Tree, corner| {
            let few = format!("takes more than {SLOTS} values at a time: split it in two formulas");
            Program::new(tree, Kinks { corner, steep_sign }).ok_or(few)
        };
        let program = compiled(&tree, corner)?;
        let switch = corner.map(|argument| compiled(argument, None)).transpose()?;
        let loose = corner.map(|_| compiled(&tree, None)).transpose()?;
        let only_rubs = jumps && is_odd(&program, &parameters);
        let timed = tree.names(|v| v == Variable::Phase);
        let driven = timed || tree.names(|v| v == Variable::Pivot);
        let action = action(&tree, jumps, only_rubs, driven || corner.is_some());
        let bare =
            |tree: &Tree| probe::usual(&parameters).any(|values| bar(tree, &values).is_some());
        let mappable = if bare(&tree) {
            Mappable::No
        } else if tree.names(|v| v == Variable::Lab) {
            Mappable::Frozen
        } else {
            Mappable::Yes
        };
        let group = match action {
            _ if timed => Group::Drive,
            Action::Position => Group::Torque,
            _ => Group::Damping,
        };
        let mut spec = spec.clone();
        for (own, known) in roles.into_iter().zip(&mut spec.parameters) {
            known.role = Some(own);
        }
        let whole = Self {
            spec,
            group,
            action,
            mappable,
            tree,
            program,
            switch,
            loose: None,
            timed,
            driven,
        };
        let Some(program) = loose else { return Ok(Arc::new(whole)) };
        let (spec, tree) = (whole.spec.clone(), whole.tree.clone());
        let loose = Self { spec, tree, program, switch: None, loose: None, ..whole };
        Ok(Arc::new(Self { loose: Some(Arc::new(loose)), ..whole }))
    }

    /// Its definition as an effect.
    #[must_use]
    pub fn definition(&self) -> Definition<'_> {
        let Self { spec, group, action, mappable, .. } = self;
        let said = spec.revealed_by.as_str();
        Definition {
            name: &spec.name,
            group: *group,
            family: Family::Own,
            action: *action,
            formula: &spec.term,
            parameters: Parameters::Formula(&spec.parameters),
            revealed_by: if said.is_empty() { revealed_by(*group, *action) } else { said },
            mappable: *mappable,
        }
    }

    /// Whether it is proportional to its first parameter, as a candidate must be.
    #[must_use]
    pub fn is_proportional(&self) -> bool {
        let parameters: Vec<Parameter> =
            self.spec.parameters.iter().map(ParameterSpec::parameter).collect();
        probe::is_proportional(&self.tree, &parameters)
    }

    /// Whether it changes with the phase of the drive, also where the pivot rests.
    #[must_use]
    pub fn is_timed(&self) -> bool {
        self.timed
    }

    /// Whether it changes with the drive.
    #[must_use]
    pub fn is_driven(&self) -> bool {
        self.driven
    }

    /// The version that steps over its corner.
    #[must_use]
    pub fn loosened(self: &Arc<Self>) -> Arc<Self> {
        self.loose.as_ref().unwrap_or(self).clone()
    }

    /// Its whole torque, in the sense of the motion that is held.
    #[inline(always)]
    pub fn whole<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        self.program.run(parameters, at)
    }

    /// The magnitude of its friction: half of its decrease as the sense changes.
    pub fn friction<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> R {
        if !self.rubs() {
            return at.constant(0.0);
        }
        let [forth, back] = [1.0, -1.0]
            .map(|sense| self.whole(parameters, &Point { sense: at.constant(sense), ..*at }));
        (back - forth).scale(0.5)
    }

    fn rubs(&self) -> bool {
        let frictions = [Action::Friction, Action::SlidingFriction, Action::LoadedFriction];
        frictions.contains(&self.action)
    }

    /// The argument of its absolute value.
    #[inline(always)]
    pub fn switch<R: Real>(&self, parameters: &[R; MOST_PARAMETERS], at: &Point<R>) -> Option<R> {
        match &self.switch {
            Some(program) => Some(program.run(parameters, at)),
            None => None,
        }
    }

    /// Whether it pushes the mirrored motion the other way.
    #[must_use]
    pub fn keeps_mirror(&self, parameters: &[f64; MOST_PARAMETERS]) -> bool {
        probe::mirrors(&self.tree, parameters, 0.0)
    }

    /// Whether mirror images half a period of the drive later stay mirror images.
    #[must_use]
    pub fn keeps_mirror_later(&self, parameters: &[f64; MOST_PARAMETERS]) -> bool {
        probe::mirrors(&self.tree, parameters, PI)
    }

    /// Whether it pulls back from however many turns away.
    #[must_use]
    pub fn counts_turns(&self, parameters: &[f64; MOST_PARAMETERS]) -> bool {
        probe::pulls_back(&self.tree, parameters)
    }

    /// Reason for which a map cannot have it with these parameters.
    #[must_use]
    pub fn bars_maps(&self, parameters: &[f64; MOST_PARAMETERS]) -> Option<&'static str> {
        bar(&self.tree, parameters)
    }
}

impl ParameterSpec {
    /// The parameter of the effect.
    #[must_use]
    pub fn parameter(&self) -> Parameter<'_> {
        let whole = self.power.fract() == 0.0 && self.power.abs() < 64.0;
        Parameter {
            name: &self.name,
            role: self.role.unwrap_or(Role::Size),
            unit: &self.unit,
            power: match self.less {
                Some(place) => Power::TwoMinus(place),
                None if whole => Power::Of(self.power as i32),
                None => Power::Real(self.power),
            },
            range: self.range,
            typical: self.typical,
            meaning: &self.meaning,
        }
    }
}

/// Whether all of it changes its sign with the sense of the motion.
fn is_odd(program: &Program, parameters: &[Parameter]) -> bool {
    probe::usual(parameters).all(|values| {
        let given = std::array::from_fn(|k| values.get(k).copied().unwrap_or(0.0));
        [0.7_f64, -0.4, 1.9].into_iter().all(|velocity| {
            let theta = 2.0 * velocity + 0.3;
            let at = |sense: f64| Point {
                theta,
                velocity,
                sense,
                side: 1.0,
                sine: theta.sin(),
                vertical: 1.0 + 0.3 * velocity,
                per_gravity: 1.0,
                lab: 3.0,
                phase: 1.1 - velocity,
                past: [theta, sense],
                sway: [0.0; 2],
            };
            let [forth, back] = [1.0, -1.0].map(|sense| program.run(&given, &at(sense)));
            (forth + back).abs() <= 1e-12 * (forth.abs() + back.abs())
        })
    })
}

/// The route through the kernel.
fn action(tree: &Tree, jumps: bool, only_rubs: bool, loaded: bool) -> Action {
    let mut speeds = false;
    let mut beside = false;
    tree.functions(&mut |function, inner| {
        let kink = matches!(function, Function::Abs | Function::Sign) && inner.is_velocity();
        speeds |= kink;
        beside |= kink && function == Function::Abs;
    });
    let plain = beside || tree.names_velocity_plainly();
    match (jumps, speeds) {
        (true, _) if loaded => Action::LoadedFriction,
        (true, _) if plain || !only_rubs => Action::SlidingFriction,
        (true, _) => Action::Friction,
        (false, true) => Action::Kinked,
        (false, false) if tree.names(|v| v == Variable::Velocity) => Action::Velocity,
        (false, false) => Action::Position,
    }
}

fn bar(tree: &Tree, values: &[f64]) -> Option<&'static str> {
    if !probe::repeats_every_turn(tree, values) && !probe::pulls_back(tree, values) {
        return Some(NOT_PERIODIC);
    }
    (!probe::repeats_every_period(tree, values)).then_some(NOT_IN_STEP)
}

const fn revealed_by(group: Group, action: Action) -> &'static str {
    match (group, action) {
        (Group::Drive, _) => "forced runs at several frequencies",
        (_, Action::Position) => "large swings and turns",
        (_, Action::Friction | Action::SlidingFriction | Action::LoadedFriction) => {
            "the last swings, and large ones"
        }
        _ => "large amplitudes and rotation, against small ones",
    }
}
