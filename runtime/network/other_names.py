"""What block types of other tools are called here.

In: a type that does not exist here, ``Saturation``. Out: ``; here: Clip``, for the error message.
"""

from __future__ import annotations

# Our type, or what to do instead, to the names that Simulink, bdsim, PathSim and others use.
_NAMES: dict[str, str] = {
    "an entry of 'probes:' records a signal and draws it": (
        "scope scopexy scope2d display toworkspace print watch null sink terminator "
        "realtimescope plot recorder logger"
    ),
    "Clip": "saturation saturate limiter limit clamp bound sat",
    "DeadZone": "deadband deadzone dead_zone",
    "RateLimiter": "ratelimit slewrate slew rate_limiter",
    "Relay": "hysteresis schmitttrigger thermostat bangbang",
    "Quantizer": "quantize quantise quantiser adc dac",
    "LookupTable": "lut lut1d lookup lookuptable1d interpolate interp 1dlookuptable",
    "LookupTable2D": "lut2d lookup2d 2dlookuptable",
    "Hold": "zoh zeroorderhold samplehold sampleandhold sampler",
    "UnitDelay": "register memory z1 unit_delay",
    "Delay": "transportdelay timedelay deadtime tappeddelay integerdelay variabletransportdelay",
    "Concatenate": "vectorconcatenate bus buscreator vectormux merge join stack",
    "a slice on the wire, as in 'a.out[0:2]', or Select": (
        "demux busselector slice slice1 slice2 index selector split item"
    ),
    "MultiportSwitch": "multiswitch multiport multiplexer indexswitch",
    "Function": (
        "fcn math expression matlabfunction interpretedfunction pow power sqrt abs sin cos tan exp "
        "log mod atan atan2 polynomial lambda polyval sign square trigonometricfunction cosh sinh "
        "tanh log10 powprod source rescale gaussianpulsesource"
    ),
    "Sum": "adder add subtract sumofelements difference plus minus",
    "Product": "prod mul multiply multiplier divide divider dotproduct",
    "Gain": "amplifier amp scale slidergain matrix matrixmultiply matrixgain",
    "FourierTransform": "fft rfft dft fouriertransform spectrum",
    "InverseFourierTransform": "ifft irfft idft",
    "Compare": (
        "comparator greaterthan lessthan equal relationaloperator comparetoconstant threshold"
    ),
    "Logic": "logicand logicor logicnot logicaloperator and or not xor",
    "Sine": "sinewave sinusoidalsource cosine waveform sinusoid signalgenerator",
    "Step": "stepsource heaviside",
    "Pulse": (
        "squarewave squarewavesource pulsegenerator pulsesource trianglewavesource sawtooth pwm "
        "clocksource"
    ),
    "Chirp": "chirpsource sweepsource chirpsignal chirpphasenoisesource",
    "Piecewise": "fromworkspace repeatingsequence signalbuilder timetable fromspreadsheet",
    "Clock": "time digitalclock",
    "WhiteNoise": (
        "noise bandlimitedwhitenoise randomnumber gaussiannoise rng uniformrandomnumber "
        "randomnumbergenerator"
    ),
    "WhiteSignal": "bandlimitedsignal bandlimitedrandom",
    "PinkNoise": "oneoverfnoise 1/fnoise flickernoise pink",
    "RandomWalk": "browniannoise wienerprocess brownian wiener",
    "TransferFunction": (
        "transferfcn transferfunctionnumden lti ltisiso lti_siso tf pt1 leadlag fopdt firstorder "
        "transferfunctionprc allpassfilter"
    ),
    "ZeroPoleGain": "zpk zeropole transferfunctionzpg zerospolesgain polezero",
    "StateSpace": "ltiss lti_ss ss statespacemodel",
    "SecondOrder": "pt2 secondordersystem sopdt",
    "Derivative": "deriv differentiator derivativefilter differentiate deriv2",
    "DynamicSystem": "ode dynamicalsystem dynamicalfunction odeblock",
    "DiscreteSystem": (
        "counter statemachine differenceequation discretefunction counterup counterdown"
    ),
    "AlgebraicConstraint": "algebraicloop solve root constraint",
    "Butterworth": (
        "butterworthlowpassfilter butterworthhighpassfilter butterworthbandpassfilter "
        "butterworthbandstopfilter analogfilterdesign"
    ),
    "FromFile": "fromcsv timeseriessource readfile csv",
    "ExtendedKalmanFilter": "ekf",
    "'run: {stop: {when: a.out, above: 1}}' ends a run": "stop stopsimulation",
    "DynamicSystem with 'when' and 'then'": "event zerocrossing zerocrossingup zerocrossingdown",
    "a Function of t with a RandomWalk in its phase": "sinusoidalphasenoisesource",
    "a part with a block Enable": "enabledsubsystem enableport",
    "a part with a block Trigger": "triggeredsubsystem triggerport",
    "PID": "pidcontroller antiwinduppid pidcontrol pi pd",
    "DiscretePID": "pids pid_s discretepidcontroller digitalpid",
    "DiscreteTransferFunction": (
        "discretetransferfcn discretefilter fir filter iir ltisisos dtf digitalfilter lti_siso_s "
        "derivs discretederivative"
    ),
    "DiscreteStateSpace": "discretess ltisss lti_ss_s dss",
    "DiscreteIntegrator": "dintegrator integrators discretetimeintegrator accumulator integrator_s",
    "MovingAverage": "movingmean rollingmean average boxcar",
    "DifferentialDrive": "diffsteer differentialsteer",
    "Pendulum": "simplependulum",
    "CartPole": "invertedpendulum cartpendulum",
    "a part, {graph: part.yaml}": "subsystem interface inport outport model",
}
_OURS = {name: ours for ours, names in _NAMES.items() for name in names.split()}


def ours_for(name: str) -> str:
    """What to use for another tool's block type: ``; here: Clip``; '' if it is not known."""
    ours = _OURS.get(name.lower().replace(" ", "").replace("-", ""))
    ours = ours or _OURS.get(name.lower().replace("_", ""))
    return "" if ours is None else f"; here: {ours}"
