"""The supply of one robot: one source, its resistance, and both drives on the same bus.

    V = V_0 − R I,  I = P / V      ⇒      V² − V_0 V + R P = 0                                  (1)
    V = (V_0 + √(V_0² − 4 R P)) / 2,   the root that tends to V_0 as P → 0                      (2)

    V_0  open-circuit voltage  [V]       P  power of both drives, standby included  [W]
    R    source resistance     [ohm]     P < 0: the wheels brake and feed the bus

    situation                       bus voltage
    0 ≤ P ≤ V_0²/(4R)               (2), between V_0/2 and V_0
    P > V_0²/(4R) = P_max           no operating point exists: the bus collapses along the source's
                                    line to V_0/2 · P_max/P, which drives answer with an
                                    under-voltage trip
    P < 0, the source absorbs       (2), above V_0: a battery
    P < 0, it doesn't               all of it charges the bus capacitor, C V dV/dt = −P, and the
                                    source is cut off until the drives have drawn that energy
                                    again: a bench supply, which braking takes to over-voltage

The voltage is the one that holds to the end of the last step; the time constant R C of a source
that is in contact is far below a substep and left out.
"""

from math import sqrt

from configs import powertrain


class Supply:
    """One source and its bus."""

    __slots__ = ("_model", "_open_circuit_V", "bus_V", "left_A", "right_A")

    def __init__(self, model: powertrain.Supply) -> None:
        self._model = model
        self._open_circuit_V = model.voltage_V
        self.bus_V = model.voltage_V
        """Voltage at both drives [V], never negative."""
        self.right_A = self.left_A = 0.0
        """Current that each drive takes from the bus [A]; negative while it feeds it."""

    def step(self, right_W: float, left_W: float, dt_s: float) -> None:
        """Set the electrical power of both motors, held over `dt_s`; finite."""
        model = self._model
        right_W += model.standby_W
        left_W += model.standby_W
        power = right_W + left_W
        source = self._open_circuit_V
        if not model.absorbs and (power < 0.0 or self.bus_V > source):
            bus = self._float(power, dt_s)
        else:
            discriminant = source * source - 4.0 * model.resistance_ohm * power
            if discriminant >= 0.0:
                bus = 0.5 * (source + sqrt(discriminant))
            else:
                bus = self._collapse(power)
        self.bus_V = bus
        if bus > 0.0:
            self.right_A, self.left_A = right_W / bus, left_W / bus
        else:
            self.right_A = self.left_A = 0.0

    def apply(self, open_circuit_V: float | None) -> None:
        """Let the source have this open-circuit voltage from now on; None: its own."""
        self._open_circuit_V = self._model.voltage_V if open_circuit_V is None else open_circuit_V

    def _float(self, power: float, dt_s: float) -> float:
        """Voltage of the capacitor alone, no lower than where the source takes over."""
        charge = self.bus_V * self.bus_V - 2.0 * power * dt_s / self._model.capacitance_F
        return max(sqrt(max(charge, 0.0)), self._open_circuit_V)

    def _collapse(self, power: float) -> float:
        most = self._open_circuit_V * self._open_circuit_V / (4.0 * self._model.resistance_ohm)
        return 0.5 * self._open_circuit_V * (most / power)
