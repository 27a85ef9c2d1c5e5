"""The law as an FMU of FMI 2.0, by the foreign generator pythonfmu."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Law(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.integral = 0.0
        for name in ("desired_z", "estimated_z", "ahead_z"):
            self._add(name, causality=Fmi2Causality.input)
        for name in ("gain", "rise", "event_s"):
            self._add(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
        for name in ("z", "error"):
            self._add(name, causality=Fmi2Causality.output)

    def _add(self, name, **kind):
        setattr(self, name, 0.0)
        self.register_variable(Real(name, **kind))

    def do_step(self, current_time, step_size):
        self.error = self.desired_z - self.estimated_z
        self.integral += self.error
        self.z = self.ahead_z + self.gain * self.error + 0.001 * self.integral
        if current_time >= self.event_s:
            self.z += self.rise
        return True
