"""How the Traffic Manager is made to accelerate as is wished: by the speed that it is to desire.

Its controller (``PIDController.h`` and ``MotionPlanStage.cpp`` of LibCarla, 0.9.13 to 0.9.16)
answers to the error of the speed as a share of the desired speed. So a desired speed a little above
or below the present one stands for a position of the pedals. It looks at the end of the step that
is to come, so that the speed there has to be foreseen.
"""

from __future__ import annotations

from typing import List, NamedTuple, Sequence, Tuple

from carstage.spec import ComfortSpec

KMH_PER_M_S = 3.6
_STANDS_M_S = 0.3

# Of the Traffic Manager: gains, the step that they are for, the ends of its pedals.
_DT_S = 0.05
_FAST_M_S = 60.0 / KMH_PER_M_S
_GAINS, _FAST_GAINS = (12.0, 0.05, 0.02), (20.0, 0.05, 0.01)
_THROTTLE_END, _BRAKE_END = 0.85, 0.7
_EMERGENCY_BRAKE = 0.95
_SIGN_S = 3.5
"""It slows down for signs that it will reach within this time at the desired speed."""

# Of Unreal's vehicles: pedals move so fast, and do so much at their ends.
_PARTS = 5
_PRESSED_PER_S, _RELEASED_PER_S = 6.0, 10.0
_FULL_THROTTLE_M_S2, _FULL_BRAKE_M_S2 = 5.0, 8.5

# Our own: pedal for an acceleration, and for being slower than planned.
_THROTTLE_PER_M_S2, _BRAKE_PER_M_S2 = 0.19, 0.12
_PEDAL_PER_M_S, _PEDAL_PER_M = 0.35, 0.25
_MOST_HELD = 0.3
_MOST_AHEAD_M_S = 0.6
_COASTING = 0.04
_HARD_M_S2, _HARD_JERK = 2.5, 3.0
"""A wish to brake that much may come that many times as fast."""
_LAUNCHED_M_S = 2.0
_LEAST_M_S, _SURELY_M_S = 0.05, 0.01
_FIRST_START_M_S, _STARTING_M_S = 0.5, 0.15
"""So much more than its speed is asked of who starts: less would soon be braked for."""
_KNOWN_STEPS = 20
_MOST_UNHEEDED = 3.0
"""So many answers as if there were no sign, and none is reckoned with any more."""


class Sign(NamedTuple):
    """What the Traffic Manager slows down for.

    Attributes:
        distance_m: as the crow flies.
        speed_m_s: that it has there.
    """

    distance_m: float
    speed_m_s: float

    def lowered(self, desired_m_s: float) -> float:
        """What the Traffic Manager makes of a desired speed."""
        far_m = _SIGN_S * desired_m_s
        if self.distance_m > far_m or desired_m_s <= self.speed_m_s:
            return desired_m_s
        return self.speed_m_s + (desired_m_s - self.speed_m_s) * self.distance_m / far_m

    def raised(self, wanted_m_s: float) -> float:
        """The desired speed that it makes a wanted one of, as far as there is one."""
        if self.distance_m > _SIGN_S * wanted_m_s or wanted_m_s <= self.speed_m_s:
            return wanted_m_s
        share = _SIGN_S * (wanted_m_s - self.speed_m_s) / max(self.distance_m, _LEAST_M_S)
        return self.speed_m_s / (1.0 - min(share, 0.9))


class _Car:
    """Foresees how the speed changes.

    What a server tells as the speed is that at the end of a step or, in the embedded simulator,
    the mean of the step. Whichever foresees better is used.

    Args:
        step_s: simulated time of a step.
    """

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self._part_s = step_s / _PARTS
        self._late = [(part + 0.5) / _PARTS for part in range(_PARTS)]
        self._throttle = self._brake = 0.0
        self._felt: Sequence[float] = [0.0] * _PARTS
        self._beside = 0.0
        self._misses = [0.0, 0.0]
        self._learnt = 0

    @property
    def knows(self) -> bool:
        """Whether it has seen enough to foresee well."""
        return self._learnt > _KNOWN_STEPS

    def change(self, last_m_s: float, moves: bool, pedal_was: float, pedal: float) -> float:
        """How much faster it will be after the coming step, m/s.

        Args:
            last_m_s: how much faster it has become in the last one.
            moves: whether it moves by now.
            pedal_was, pedal: throttle (above 0) or brake (below) in the last and the coming step.
        """
        felt = self._press(pedal_was)
        if moves:
            self._learn(last_m_s / self._step_s, self._means(self._felt, felt))
        self._felt = felt
        place = self._throttle, self._brake
        coming = self._press(pedal)
        self._throttle, self._brake = place
        foreseen = self._means(felt, coming)[self._better]
        return self._step_s * (foreseen + (self._beside if moves else 0.0))

    @property
    def _better(self) -> int:
        return 0 if self._misses[0] <= self._misses[1] else 1

    def _learn(self, told_m_s2: float, foreseen: Tuple[float, float]) -> None:
        """Slopes, gears and drag are what remains; which of the two ways misses less."""
        self._learnt += 1
        miss = min(max(told_m_s2 - foreseen[self._better], -3.0), 3.0)
        self._beside += 0.25 * (miss - self._beside)
        for way in (0, 1):
            missed = told_m_s2 - foreseen[way] - self._beside
            self._misses[way] += 0.02 * (missed * missed - self._misses[way])

    def _press(self, pedal: float) -> List[float]:
        """Move the pedals for a step; the acceleration in each part of it, m/s²."""
        pressed, released = _PRESSED_PER_S * self._part_s, _RELEASED_PER_S * self._part_s
        to_throttle, to_brake = (pedal, 0.0) if pedal > 0.0 else (0.0, -pedal)
        throttle, brake = self._throttle, self._brake
        felt = []
        for _ in range(_PARTS):
            throttle = _moved(throttle, to_throttle, pressed, released)
            brake = _moved(brake, to_brake, pressed, released)
            felt.append(_FULL_THROTTLE_M_S2 * throttle - _FULL_BRAKE_M_S2 * brake)
        self._throttle, self._brake = throttle, brake
        return felt

    def _means(self, last: Sequence[float], coming: Sequence[float]) -> Tuple[float, float]:
        """The acceleration between the mean speeds of two steps, and between their ends."""
        mean = 0.0
        for late, before, after in zip(self._late, last, coming):
            mean += late * before + (1.0 - late) * after
        return mean / _PARTS, sum(coming) / _PARTS


def _moved(place: float, to: float, pressed: float, released: float) -> float:
    """Where a pedal is after a while in which it can be pressed or released so far."""
    if place == to:
        return to
    if to > place:
        place += pressed
        return place if place < to else to
    place -= released
    return place if place > to else to


class Pedals:
    """Finds the speed that the Traffic Manager is to desire, step by step.

    Args:
        comfort: what is comfortable.
        step_s: simulated time of a step.
    """

    def __init__(self, comfort: ComfortSpec, step_s: float) -> None:
        self._jerk_m_s3 = comfort.jerk_m_s3
        self._step_s = step_s
        self._car = _Car(step_s)
        self._acceleration = 0.0
        self._planned_m_s = 0.0
        self._held = 0.0
        self._speed_m_s = 0.0
        self._desired_m_s = 0.0
        self._error = 0.0
        self._answer = 0.0
        self._raised = self._answer_raised = False
        self._unheeded = 0.0

    def desired_m_s(
        self, speed_m_s: float, wish_m_s2: float, pedal_was: float, signs: Sequence[Sign]
    ) -> float:
        """The speed to desire from now on.

        Args:
            speed_m_s: now.
            wish_m_s2: the acceleration that is wished for.
            pedal_was: throttle (above 0) or brake (below) of the last step.
            signs: what the Traffic Manager slows down for.
        """
        limited = pedal_was < self._answer - 0.1
        if not self._heeds_signs(pedal_was):
            signs = ()
        if pedal_was < -_EMERGENCY_BRAKE:
            self._acceleration, self._held = min(self._acceleration, 0.0), 0.0
            self._planned_m_s = speed_m_s
        elif limited:
            self._acceleration = min(self._acceleration, 0.5)
        self._answer_to(speed_m_s)
        most = self._jerk_m_s3 * self._step_s * (_HARD_JERK if wish_m_s2 < -_HARD_M_S2 else 1.0)
        self._acceleration += min(max(wish_m_s2 - self._acceleration, -most), most)
        last_m_s, self._speed_m_s = speed_m_s - self._speed_m_s, speed_m_s
        moves = speed_m_s > _STANDS_M_S
        change_m_s = self._car.change(last_m_s, moves, pedal_was, self._answer)
        foreseen_m_s = max(speed_m_s + change_m_s, 0.0)
        starts = not moves and self._acceleration > 0.0
        more_m_s = _STARTING_M_S if self._car.knows else _FIRST_START_M_S
        surely_m_s = speed_m_s + more_m_s if starts else 0.0
        return self._asked(foreseen_m_s, self._pedal(foreseen_m_s, limited), surely_m_s, signs)

    def _heeds_signs(self, pedal_was: float) -> bool:
        """Whether the Traffic Manager slows down for signs: 0.9.13's drove as fast as was asked."""
        if self._answer_raised:
            heeded = pedal_was < self._answer + 0.2
            self._unheeded = max(self._unheeded + (-0.1 if heeded else 1.0), 0.0)
        return self._unheeded < _MOST_UNHEEDED

    def _answer_to(self, speed_m_s: float) -> None:
        """What the Traffic Manager has answered to this speed already, for the coming step."""
        proportional, integral, derivative = _gains(speed_m_s)
        error = 1.0
        if self._desired_m_s > 0.0:
            error = (self._desired_m_s - speed_m_s) / self._desired_m_s
        answer = proportional * error
        answer += integral * (error + self._error) + derivative * (error - self._error)
        self._answer = min(max(answer, -_BRAKE_END), _THROTTLE_END)
        self._error, self._answer_raised = error, self._raised

    def _pedal(self, foreseen_m_s: float, limited: bool) -> float:
        """Where the pedals should be in the step after the coming one."""
        planned = self._planned_m_s + self._acceleration * self._step_s
        if limited:
            planned = min(planned, foreseen_m_s + 0.1)
        elif self._acceleration > 0.0 and foreseen_m_s < _LAUNCHED_M_S:
            planned = max(planned, foreseen_m_s)
        low, high = foreseen_m_s - _MOST_AHEAD_M_S, foreseen_m_s + _MOST_AHEAD_M_S
        self._planned_m_s = max(min(max(planned, low), high), 0.0)
        ahead = self._planned_m_s - foreseen_m_s
        if not limited:
            held = self._held + _PEDAL_PER_M * ahead * self._step_s
            self._held = min(max(held, -_MOST_HELD), _MOST_HELD)
        share = _THROTTLE_PER_M_S2 if self._acceleration > 0.0 else _BRAKE_PER_M_S2
        pedal = share * self._acceleration + _PEDAL_PER_M_S * ahead + self._held
        return 0.0 if -_COASTING < pedal < 0.0 else min(max(pedal, -_BRAKE_END), _THROTTLE_END)

    def _asked(
        self, foreseen_m_s: float, pedal: float, least_m_s: float, signs: Sequence[Sign]
    ) -> float:
        """The desired speed that puts the pedals there, signs or not; at least some speed."""
        proportional, integral, derivative = _gains(foreseen_m_s)
        error = pedal - (integral - derivative) * self._error
        error /= proportional + integral + derivative
        wanted_m_s = max(foreseen_m_s, _LEAST_M_S) / (1.0 - min(error, 0.9))
        wanted_m_s = max(wanted_m_s, least_m_s)
        if self._acceleration > 0.3:
            wanted_m_s = max(wanted_m_s, foreseen_m_s + _SURELY_M_S)
        nearer_m = foreseen_m_s * self._step_s
        signs = [Sign(max(sign.distance_m - nearer_m, 0.1), sign.speed_m_s) for sign in signs]
        asked_m_s = max([wanted_m_s] + [sign.raised(wanted_m_s) for sign in signs])
        self._raised = asked_m_s > wanted_m_s + _SURELY_M_S
        self._desired_m_s = min([wanted_m_s] + [sign.lowered(asked_m_s) for sign in signs])
        return asked_m_s


def _gains(speed_m_s: float) -> Tuple[float, float, float]:
    """Of the speed error, its sum over a step, and its change in one."""
    proportional, integral, derivative = _FAST_GAINS if speed_m_s > _FAST_M_S else _GAINS
    return proportional, integral * _DT_S, derivative / _DT_S
