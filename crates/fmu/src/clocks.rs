//! Clocks of FMI 3.0: parts of a model that run when their clocks tick.

use std::marker::PhantomData;

use crate::definition::SAMPLE_TIME;
use crate::discrete_state::{Word, Words};
use crate::model::{Continuous, Discrete, Sample};
use crate::runner::MOST_PARTS;
use crate::store::ValueStore;
use crate::timeline::slack;
use crate::variable::{Kind, Layout, Role};

/// A triggered output clock (FMI 3.0, section 2.2.8): the model lets it tick, and the importer then activates the input
/// clocks that are connected to it. It is the type of a field of the outputs.
///
/// FMI 2.0 has no clocks: there, it is a Boolean output that is true if the clock ticked during the last step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Clock(pub(crate) bool);

impl Clock {
    /// Lets the clock tick at the present event.
    pub fn fire(&mut self) {
        self.0 = true;
    }

    /// Returns true if the clock ticks.
    #[must_use]
    pub fn has_fired(self) -> bool {
        self.0
    }
}

/// A time interval: an exact fraction of seconds, or a number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Span {
    /// A number in s.
    Decimal(f64),
    /// Numerator and denominator, in s.
    Fraction(u64, u64),
}

impl Span {
    /// The length in s.
    pub const fn seconds(self) -> f64 {
        match self {
            Self::Decimal(seconds) => seconds,
            Self::Fraction(counter, resolution) => counter as f64 / resolution as f64,
        }
    }

    /// Two words from which [`Self::set`] makes the same length. They are not both 0.
    pub(crate) const fn words(self) -> [u64; 2] {
        match self {
            Self::Decimal(0.0) => [(-0.0_f64).to_bits(), 0],
            Self::Decimal(seconds) => [seconds.to_bits(), 0],
            Self::Fraction(counter, resolution) => [counter, resolution],
        }
    }

    /// Takes over a length that an importer has set.
    fn set(&mut self, words: &[u64]) {
        match *words {
            [0, 0] => {}
            [number, 0] => *self = Self::Decimal(f64::from_bits(number)),
            [counter, resolution] => *self = Self::Fraction(counter, resolution),
            _ => unreachable!("two words"),
        }
    }
}

/// The interval of an input clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interval {
    /// The same in all runs.
    Constant(Span),
    /// The value of a real parameter, in s.
    Of(&'static str),
}

/// When the importer may set interval and shift of a periodic clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// Never.
    Never,
    /// In Initialization Mode.
    Fixed,
    /// In Initialization Mode; the interval also later.
    Tunable,
}

/// When an input clock ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Timing {
    /// At equal intervals, for the first time `shift` after the start.
    Periodic {
        /// Time from one tick to the next.
        interval: Interval,
        /// Time of the first tick after the start.
        shift: Span,
        /// When the importer may set them.
        setting: Setting,
    },
    /// At intervals that the model chooses at each tick. The first tick is one interval after the start.
    Changing(Interval),
    /// When the model has started it with [`TickOf::start`]; with an interval, also once after the start.
    Countdown(Option<Interval>),
    /// When the importer activates it.
    Triggered,
}

impl Timing {
    /// A periodic clock. Two fractions get the same denominator, because an FMI clock has only one; a number and a
    /// fraction are both written as numbers.
    pub const fn periodic(interval: Interval, shift: Option<Span>, setting: Setting) -> Self {
        let (interval, shift) = match (interval, shift) {
            (Interval::Constant(Span::Fraction(counter, resolution)), None) => {
                (Span::Fraction(counter, resolution), Span::Fraction(0, resolution))
            }
            (Interval::Constant(Span::Fraction(a, b)), Some(Span::Fraction(c, d))) => {
                let common = product(b / greatest_common_divisor(b, d), d);
                let interval = Span::Fraction(product(a, common / b), common);
                (interval, Span::Fraction(product(c, common / d), common))
            }
            (Interval::Constant(interval), shift) => (
                Span::Decimal(interval.seconds()),
                Span::Decimal(match shift {
                    Some(shift) => shift.seconds(),
                    None => 0.0,
                }),
            ),
            (interval @ Interval::Of(_), shift) => {
                let shift = Span::Decimal(match shift {
                    Some(shift) => shift.seconds(),
                    None => 0.0,
                });
                return Self::Periodic { interval, shift, setting };
            }
        };
        Self::Periodic { interval: Interval::Constant(interval), shift, setting }
    }

    /// Returns true if the importer may set interval and shift.
    pub(crate) const fn is_settable(self) -> bool {
        matches!(self, Self::Periodic { setting: Setting::Fixed | Setting::Tunable, .. })
    }

    pub(crate) const fn interval(self) -> Option<Interval> {
        match self {
            Self::Periodic { interval, .. } | Self::Changing(interval) | Self::Countdown(Some(interval)) => {
                Some(interval)
            }
            Self::Countdown(None) | Self::Triggered => None,
        }
    }
}

const fn product(a: u64, b: u64) -> u64 {
    match a.checked_mul(b) {
        Some(product) => product,
        None => panic!("the common denominator of interval and shift does not fit in 64 bits"),
    }
}

const fn greatest_common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// An input clock and its part of the model. [`model`](macro@crate::model) makes it from a method with `#[clock(…)]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputClock {
    /// Name of the clock.
    pub name: &'static str,
    /// Description: the doc comment of the method.
    pub description: &'static str,
    /// When it ticks.
    pub timing: Timing,
    /// Order of clocks that tick at the same time in scheduled execution; smaller numbers are first.
    pub priority: Option<u32>,
}

/// The clock of a discrete-time model without clocks of its own, with `cargo fmu pack --clocks`.
pub(crate) const SAMPLE: InputClock = InputClock {
    name: "sample",
    description: "Takes a sample",
    timing: Timing::periodic(Interval::Of(SAMPLE_TIME.name), None, Setting::Never),
    priority: Some(0),
};

/// Returns true if there are clocks, and all have a priority.
pub(crate) const fn have_priorities(clocks: &[InputClock]) -> bool {
    let mut at = 0;
    while at < clocks.len() {
        if clocks[at].priority.is_none() {
            return false;
        }
        at += 1;
    }
    at > 0
}

/// A discrete-time model that [`ClockedModel`](crate::runner::ClockedModel) can run. [`model`](macro@crate::model)
/// implements it.
pub trait Clocked: Discrete<Outputs: Send> {
    /// The input clocks, in the order of the methods. A model without them can be packed with the clock
    /// `sample`, which ticks at its sample times.
    const CLOCKS: &'static [InputClock] = &[];
    /// A schedule per input clock.
    type Schedules: Schedules;
    /// The clocks that [`TickOf::start`] can start.
    type Timers: Into<usize>;

    /// Runs the method of the input clock with this position in [`Self::CLOCKS`]; without clocks, takes one sample.
    fn tick(&self, _clock: usize, tick: DiscreteTick<'_, Self>) {
        let TickOf { time, state, inputs, derived, .. } = tick;
        *tick.outputs = self.update(Sample { time, state, inputs, derived });
    }
}

/// A schedule per input clock.
pub trait Schedules: AsRef<[Schedule]> + AsMut<[Schedule]> + Clone + Send + 'static {
    /// Schedules without ticks.
    const NONE: Self;
}

impl<const N: usize> Schedules for [Schedule; N] {
    const NONE: Self = [Schedule::NONE; N];
}

/// A model with clocks. [`model`](macro@crate::model) implements it.
pub trait Ticking {
    /// See [`Tick`].
    type Of<'a>;
}

/// The tick of a clock: what the method with `#[clock(…)]` of the model `M` reads and changes. See [`TickOf`].
pub type Tick<'a, M> = <M as Ticking>::Of<'a>;

/// The tick of a clock in a discrete-time model.
pub type DiscreteTick<'a, M> = TickOf<
    'a,
    <M as Discrete>::State,
    <M as Discrete>::Inputs,
    <M as Discrete>::Outputs,
    <M as Discrete>::Derived,
    (),
    <M as Clocked>::Timers,
>;

/// The tick of a clock in a continuous-time model.
pub type ContinuousTick<'a, M> = TickOf<
    'a,
    <M as Continuous>::DiscreteState,
    <M as Continuous>::Inputs<f64>,
    (),
    <M as Continuous>::Derived,
    <M as Continuous>::State<f64>,
    <M as Continuous>::Timers,
>;

/// A model without clocks that it can start.
#[derive(Clone, Copy, Debug)]
pub enum NoTimer {}

impl From<NoTimer> for usize {
    fn from(timer: NoTimer) -> Self {
        match timer {}
    }
}

/// The tick of a clock: what the method with `#[clock(…)]` reads and changes.
#[derive(Debug)]
pub struct TickOf<'a, State, Inputs, Outputs, Derived, Continuous, Timers> {
    /// Time in s.
    pub time: f64,
    /// Time in s since the last tick of this clock, or since the start; for a periodic clock, its interval.
    pub interval: f64,
    /// Discrete state; may be changed.
    pub state: &'a mut State,
    /// Inputs.
    pub inputs: &'a Inputs,
    /// Outputs of a discrete-time model, with their present values; may be changed. Those of a continuous-time model
    /// follow from its states.
    pub outputs: &'a mut Outputs,
    /// Derived parameters.
    pub derived: &'a Derived,
    /// State of a continuous-time model; may be changed.
    pub continuous: &'a mut Continuous,
    pub(crate) schedules: &'a mut [Schedule],
    pub(crate) clocks: &'static [InputClock],
    pub(crate) timers: PhantomData<Timers>,
    /// Position of this clock in `clocks`.
    pub(crate) clock: usize,
    /// Time of the event in s. With an importer that activates the clocks, it may differ from `time` by rounding
    /// errors.
    pub(crate) event: f64,
    pub(crate) fault: &'a mut Option<String>,
}

impl<S, I, O, D, X, Timers: Into<usize>> TickOf<'_, S, I, O, D, X, Timers> {
    /// Lets a `countdown` clock, or a `changing` clock at its own tick, tick next in `after` s, instead of a tick that
    /// was started before. The step fails if `after` is negative or not finite, or at a tick of another clock than the
    /// `changing` one.
    pub fn start(&mut self, clock: Timers, after: f64) {
        let clock = clock.into();
        let InputClock { name, timing, .. } = self.clocks[clock];
        let time = self.time;
        if !(after >= 0.0 && after.is_finite()) {
            *self.fault =
                Some(format!("the clock '{name}' cannot tick in {after} s, as the model requests at {time} s"));
        } else if matches!(timing, Timing::Changing(_)) && clock != self.clock {
            *self.fault = Some(format!("the `changing` clock '{name}' can be started at its own ticks only"));
        } else {
            self.schedules[clock].start(time, after);
            self.schedules[clock].deviation = (self.event - time).abs();
        }
    }
}

/// The times at which an input clock ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    /// Time in s from which the ticks of a periodic clock are counted.
    base: f64,
    /// Number of the next tick since `base`.
    pub(crate) count: u64,
    /// Time of the last tick, or of the start, in s.
    last: f64,
    /// Time of the next tick in s; infinite if it is not known.
    pub(crate) next: f64,
    /// The last interval in s that was set.
    pub(crate) interval: f64,
    /// True if the importer has not asked for the interval since it has changed.
    pub(crate) is_new: bool,
    /// Time from which the interval of an aperiodic clock counts, in s.
    from: f64,
    /// Difference between this time and the one from which the importer counts, in s.
    pub(crate) deviation: f64,
    /// Time of the present tick, and the time since the last one, in s; used during an event only.
    pub(crate) present: (f64, f64),
}

/// Number of words among the values of an instance that store the interval and then the shift of a settable clock. They
/// are 0 until the importer sets them.
pub(crate) const TIMING_WORDS: usize = 4;

/// Index of the first of the words of a clock, if it is settable.
pub(crate) fn words(clocks: &[InputClock], clock: usize, layout: &Layout) -> Option<usize> {
    let before = clocks[..clock].iter().filter(|clock| clock.timing.is_settable()).count();
    clocks[clock].timing.is_settable().then_some(layout.clocks.at.words + TIMING_WORDS * before)
}

/// A clock, with the interval and the shift that the importer has set.
pub(crate) fn present(clocks: &[InputClock], clock: usize, layout: &Layout, values: &ValueStore) -> InputClock {
    let mut present = clocks[clock];
    if let Timing::Periodic { interval: Interval::Constant(interval), shift, .. } = &mut present.timing
        && let Some(at) = words(clocks, clock, layout)
    {
        interval.set(&values.words[at..at + 2]);
        shift.set(&values.words[at + 2..at + 4]);
    }
    present
}

impl Schedule {
    /// No tick.
    pub const NONE: Self = Self {
        base: 0.0,
        count: 0,
        last: 0.0,
        next: f64::INFINITY,
        interval: f64::INFINITY,
        is_new: false,
        from: 0.0,
        deviation: 0.0,
        present: (0.0, 0.0),
    };

    /// The first tick of a clock after `start`. `interval` is the present value in s.
    fn new(timing: Timing, start: f64, interval: f64) -> Self {
        let none = Self { base: start, last: start, from: start, interval, ..Self::NONE };
        let known = |next| Self { next, is_new: true, ..none };
        match timing {
            Timing::Periodic { shift, .. } => known(start + shift.seconds()),
            Timing::Changing(_) | Timing::Countdown(Some(_)) => known(start + interval),
            Timing::Countdown(None) | Timing::Triggered => none,
        }
    }

    /// Time of the present tick in s, at an event at `time`.
    pub(crate) fn due(&self, time: f64) -> f64 {
        if self.next.is_finite() { self.next } else { time }
    }

    /// Returns true if the clock is due at `time`.
    pub(crate) fn is_due(&self, time: f64) -> bool {
        (self.next - time).abs() <= slack(self.interval.min(1.0), time) + self.deviation
    }

    /// Lets an aperiodic clock tick `after` s after `time`.
    fn start(&mut self, time: f64, after: f64) {
        // In scheduled execution, a clock may have been activated at a later time than the one that starts it.
        let next = (time + after).max(self.last);
        (self.next, self.from, self.interval, self.is_new) = (next, time, after, true);
    }

    /// The interval that an importer asks for at `time`, in s.
    pub(crate) fn interval_at(&self, timing: Timing, time: f64) -> f64 {
        match timing {
            // The importer has missed the event at which the clock was started.
            Timing::Changing(_) | Timing::Countdown(_) if self.is_new && (self.from - time).abs() > self.deviation => {
                (self.next - time).max(0.0)
            }
            _ => self.interval,
        }
    }

    /// Moves on to the tick after the one at `time`. Returns the time since the last tick in s.
    fn advance(&mut self, timing: Timing, time: f64) -> f64 {
        let passed = time - self.last;
        self.last = time;
        match timing {
            Timing::Periodic { interval: Interval::Constant(Span::Fraction(counter, resolution)), shift, .. } => {
                self.count += 1;
                // The importer may set a shift with another denominator.
                let (offset, rest) = match shift {
                    Span::Fraction(offset, of) if of == resolution => (offset, 0.0),
                    shift => (0, shift.seconds()),
                };
                let counters = u128::from(offset) + u128::from(self.count) * u128::from(counter);
                self.next = self.base + rest + counters as f64 / resolution as f64;
                self.interval
            }
            Timing::Periodic { shift, .. } => {
                self.count += 1;
                self.next = self.base + shift.seconds() + self.count as f64 * self.interval;
                self.interval
            }
            Timing::Changing(_) => {
                self.start(time, self.interval);
                passed
            }
            Timing::Countdown(_) | Timing::Triggered => {
                self.next = f64::INFINITY;
                passed
            }
        }
    }

    /// Scheduled execution: moves on to the tick after the one at `time`, which the importer has chosen. Fails if it is
    /// not later than the last one.
    pub(crate) fn activate(&mut self, clock: &InputClock, time: f64) -> Result<(), String> {
        let is_first = self.count == 0;
        if !(time > self.last || (is_first && time == self.last)) {
            let rule = if is_first { "not be before the start at" } else { "be later than its last tick at" };
            let (name, last) = (clock.name, self.last);
            return Err(format!("activationTime of the clock '{name}' must {rule} {last} s, got {time} s"));
        }
        self.next = time;
        let interval = self.advance(clock.timing, time);
        // The interval of a periodic clock counts from the start, but the importer may activate it later.
        (self.next, self.count) = (self.next.max(time), self.count.max(1));
        (self.present, self.deviation) = ((time, interval), 0.0);
        Ok(())
    }

    /// Takes over a new value of the parameter that is the interval of a periodic clock: it counts from the last tick.
    /// The first tick stays where it is.
    fn set_interval(&mut self, shift: Span, interval: f64, time: f64) {
        if interval.to_bits() == self.interval.to_bits() {
            return;
        }
        (self.interval, self.is_new) = (interval, true);
        if self.count > 0 {
            // A tick that would be in the past is due now, and the next one follows after the new interval.
            let last = self.last.max(time - interval);
            (self.base, self.count) = (last - shift.seconds(), 1);
            self.next = (last + interval).max(time);
        }
    }

    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        let Self { base, count, last, next, interval, is_new, from, deviation, .. } = *self;
        for number in [base, last, next, interval, from, deviation] {
            sink(Word::Whole(number.to_bits()));
        }
        sink(Word::Whole(count));
        sink(Word::Choice(is_new.into()));
    }

    fn restore(source: &mut Words<'_>) -> Result<Self, String> {
        let mut number = || source.whole("time of a clock").map(f64::from_bits);
        let (base, last, next, interval) = (number()?, number()?, number()?, number()?);
        let (from, deviation) = (number()?, number()?);
        let times = [base, last, from, deviation];
        if !(times.iter().all(|time| time.is_finite()) && next >= last && interval >= 0.0) {
            return Err(format!("a clock cannot tick at {last} s, then at {next} s"));
        }
        let (count, is_new) = (source.whole("count of a clock")?, source.choice("interval of a clock")? != 0);
        Ok(Self { base, count, last, next, interval, is_new, from, deviation, ..Self::NONE })
    }
}

/// The interval of a clock in s. Fails if the parameter that determines it is not above 0.
fn interval_of(clock: &InputClock, layout: &Layout, values: &ValueStore) -> Result<f64, String> {
    let (value, name) = match clock.timing.interval() {
        Some(Interval::Constant(span)) => (span.seconds(), "interval"),
        // The description checks the name.
        Some(Interval::Of(name)) => (parameter(layout, name).map_or(f64::INFINITY, |index| values.reals[index]), name),
        None => return Ok(f64::INFINITY),
    };
    if value > 0.0 {
        return Ok(value);
    }
    Err(format!("'{name}' = {value} s is the interval of the clock '{}' and must be above 0", clock.name))
}

/// Position of a real parameter with this name.
pub(crate) fn parameter(layout: &Layout, name: &str) -> Option<usize> {
    let is_it = |v: &&crate::variable::Variable| {
        v.role == Role::Parameter && v.declaration.name == name && matches!(v.declaration.kind, Kind::Real(_))
    };
    layout.variables.iter().find(is_it).map(|variable| variable.index)
}

/// The schedules at the start.
pub(crate) fn first<S: Schedules>(
    clocks: &[InputClock],
    layout: &Layout,
    values: &ValueStore,
    start: f64,
) -> Result<S, String> {
    let mut schedules = S::NONE;
    for (number, schedule) in schedules.as_mut().iter_mut().enumerate() {
        let clock = present(clocks, number, layout, values);
        *schedule = Schedule::new(clock.timing, start, interval_of(&clock, layout, values)?);
    }
    Ok(schedules)
}

/// Takes over the present values of intervals that are parameters or that the importer sets.
pub(crate) fn update_intervals(
    clocks: &[InputClock],
    schedules: &mut [Schedule],
    layout: &Layout,
    values: &ValueStore,
    time: f64,
) -> Result<(), String> {
    for (number, schedule) in schedules.iter_mut().enumerate() {
        let clock = present(clocks, number, layout, values);
        if let Timing::Periodic { shift, .. } = clock.timing {
            schedule.set_interval(shift, interval_of(&clock, layout, values)?, time);
        }
    }
    Ok(())
}

/// Moves the schedules of the active clocks on to their next ticks, at an event at `time`. A bit for each active clock.
pub(crate) fn advance(
    clocks: &[InputClock],
    schedules: &mut [Schedule],
    layout: &Layout,
    values: &ValueStore,
    (active, time): (u64, f64),
) {
    for (clock, schedule) in schedules.iter_mut().enumerate().filter(|(clock, _)| active >> clock & 1 != 0) {
        let (due, timing) = (schedule.due(time), present(clocks, clock, layout, values).timing);
        schedule.present = (due, schedule.advance(timing, due));
        schedule.deviation = (time - due).abs();
    }
}

/// The active input clocks: a bit for each.
pub(crate) fn active(layout: &Layout, values: &ValueStore) -> u64 {
    let flags = values.booleans[layout.clocks.booleans()].iter().enumerate();
    flags.fold(0, |all, (clock, &is_active)| all | u64::from(is_active) << clock)
}

/// The clocks that are due at `time`: a bit for each.
pub(crate) fn due(schedules: &[Schedule], time: f64) -> u64 {
    let due = schedules.iter().enumerate().filter(|(_, schedule)| schedule.is_due(time));
    due.fold(0, |all, (clock, _)| all | 1 << clock)
}

/// Time of the next tick in s, infinite if none is known; and the shortest interval in s, at most `step`.
pub(crate) fn next(schedules: &[Schedule], step: f64) -> (f64, f64) {
    let both =
        |(next, shortest): (f64, f64), schedule: &Schedule| (next.min(schedule.next), shortest.min(schedule.interval));
    schedules.iter().fold((f64::INFINITY, step), both)
}

/// The message if a clock that the importer activates is due before `end`, the end of a step of `step` s.
pub(crate) fn missed(clocks: &[InputClock], schedules: &[Schedule], end: f64, step: f64) -> Option<String> {
    let is_missed =
        |schedule: &Schedule| schedule.next < end - slack(step.min(schedule.interval), end) - schedule.deviation;
    let (clock, schedule) = clocks.iter().zip(schedules).find(|(_, schedule)| is_missed(schedule))?;
    Some(format!(
        "the clock '{}' ticks at {} s: end the step there, and activate the clock in Event Mode",
        clock.name, schedule.next
    ))
}

/// Maximum number of ticks of aperiodic clocks at one time.
pub(crate) const MOST_AT_ONCE: u32 = 100;

#[cold]
pub(crate) fn too_often(time: f64) -> String {
    format!("a clock ticks too often: more than {MOST_AT_ONCE} times at {time} s, or {MOST_PARTS} times in a step")
}

pub(crate) fn save(schedules: &[Schedule], sink: &mut dyn FnMut(Word<'_>)) {
    schedules.iter().for_each(|schedule| schedule.save(sink));
}

pub(crate) fn restore(schedules: &mut [Schedule], source: &mut Words<'_>) -> Result<(), String> {
    schedules.iter_mut().try_for_each(|schedule| Schedule::restore(source).map(|restored| *schedule = restored))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: 3 x 1/3 s is 1 s, and a clock of 1/100 s and one of 1/10 s tick at the same numbers; with decimal
    /// intervals, the 3rd tick of 0.1 s is at 0.30000000000000004 s.
    #[test]
    fn fractions_meet_at_the_same_numbers() {
        let ticks = |interval| {
            let timing = Timing::periodic(Interval::Constant(interval), None, Setting::Never);
            let mut schedule = Schedule::new(timing, 0.0, interval.seconds());
            std::iter::from_fn(move || {
                let next = schedule.next;
                schedule.advance(timing, next);
                Some(next)
            })
        };
        let thirds: Vec<_> = ticks(Span::Fraction(1, 3)).take(4).collect();
        assert_eq!(thirds, [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0]);
        let hundredths: Vec<_> = ticks(Span::Fraction(1, 100)).take(1001).collect();
        let tenths: Vec<_> = ticks(Span::Fraction(1, 10)).take(101).collect();
        assert!(tenths.iter().enumerate().all(|(n, time)| hundredths[10 * n] == *time));
        assert_eq!(ticks(Span::Decimal(0.1)).nth(3), Some(3.0 * 0.1));
    }

    #[test]
    fn interval_and_shift_get_a_common_denominator() {
        let setting = Setting::Fixed;
        let quarter = Interval::Constant(Span::Fraction(1, 4));
        let timing = Timing::periodic(quarter, Some(Span::Fraction(1, 6)), setting);
        let interval = Interval::Constant(Span::Fraction(3, 12));
        assert_eq!(timing, Timing::Periodic { interval, shift: Span::Fraction(2, 12), setting });
        let timing = Timing::periodic(quarter, Some(Span::Decimal(0.5)), setting);
        let interval = Interval::Constant(Span::Decimal(0.25));
        assert_eq!(timing, Timing::Periodic { interval, shift: Span::Decimal(0.5), setting });
    }

    /// FMI 3.0, section 2.2.8: t_i = t_(i-1) + the interval that is valid then.
    #[test]
    fn a_changed_interval_counts_from_the_last_tick() {
        let shift = Span::Decimal(0.5);
        let timing = Timing::periodic(Interval::Of("sample_time"), Some(shift), Setting::Never);
        let mut schedule = Schedule::new(timing, 10.0, 1.0);
        schedule.set_interval(shift, 2.0, 10.2);
        assert_eq!(schedule.next, 10.5, "the first tick stays");
        schedule.advance(timing, 10.5);
        assert_eq!(schedule.next, 12.5);
        schedule.set_interval(shift, 0.25, 10.6);
        assert_eq!(schedule.next, 10.75);
        schedule.advance(timing, 10.75);
        assert_eq!(schedule.next, 11.0);
        schedule.set_interval(shift, 0.0625, 10.9375);
        assert_eq!(schedule.next, 10.9375, "no tick in the past");
        schedule.advance(timing, 10.9375);
        assert_eq!(schedule.next, 11.0, "nor after it");
    }
}
