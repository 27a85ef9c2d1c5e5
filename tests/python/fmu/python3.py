"""The law as an FMU of FMI 3.0, by the foreign generator pythonfmu3."""

from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64


class Law(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.integral = 0.0
        self._add("time", causality=Fmi3Causality.independent, variability=Fmi3Variability.continuous)
        for name in ("desired_z", "estimated_z", "ahead_z"):
            self._add(name, causality=Fmi3Causality.input)
        for name in ("gain", "rise", "event_s"):
            self._add(name, causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable)
        for name in ("z", "error"):
            self._add(name, causality=Fmi3Causality.output)

    def _add(self, name, **kind):
        setattr(self, name, 0.0)
        self.register_variable(Float64(name, **kind))

    def do_step(self, current_time, step_size):
        self.error = self.desired_z - self.estimated_z
        self.integral += self.error
        self.z = self.ahead_z + self.gain * self.error + 0.001 * self.integral
        if current_time >= self.event_s:
            self.z += self.rise
        return True
