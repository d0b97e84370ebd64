"""Forms that random programs are made of: expressions by type, and statements.

In a form, ``{f}`` stands for an expression of that type. The types are

    f, F   a float of Python, a number of NumPy (float64)
    i, I   an integer of Python, of NumPy (int64)
    b, B   a bool of Python, of NumPy
    A, M   arrays of floats, of shapes (4,) and (2, 3)
    K, Q   arrays of shape (4,): of integers, of bools
    s      any number; S: any of f and F; e: any array of shape (4,)

``{c}`` is one name within the form, often that of a variable there is. ``{n}`` is a small integer
literal, ``{d}`` an index of four elements, ``{k}`` a place of the record ``r``. Where a line begins
with ``~``, NumPy may round otherwise than C does, and the value is only recorded.
"""

from __future__ import annotations

EXPRESSIONS: dict[str, str] = {}
STATEMENTS: dict[str, str] = {}

EXPRESSIONS["f"] = """
({f} + {f})
({f} - {f})
({f} * {s})
({f} / {f})
({f} // {f})
({f} % {f})
({i} / {i})
(-{f})
(+{f})
abs({f})
({f} ** 2)
({f} ** {n})
(abs({f}) ** 0.5)
({f} ** {f})
({i} ** -{n})
float({s})
float({i} * 2**40)
float(state.s)
float(state.h[{d}])
float({A}[{d}])
state.h[{d}].item()
state.h.tolist()[{d}]
({f} if {b} else {f})
({f} if {B} else {f})
({f} and {f})
({f} or {f})
min({f}, {f})
max({f}, {f})
max({f}, {i}, {f})
min(({f}, {f}, {f}))
max([{f}, {f}])
min({f}, math.nan)
max(math.nan, {f})
min(0.0, -0.0, {f})
sum([{c} * {c} for {c} in ({f}, {f})])
sum({c} + {f} for {c} in ({f}, {f}, {f}))
sum([{f}, {f}], {f})
sum(({f}, {i}, {f}))
?max([{c} + 1.0 for {c} in state.h.tolist()])
sum([{c} * {f} for {c} in range({n})], 0.0)
[{c} - {f} for {c} in ({f}, {f})][{n} % 2]
tuple([{c} + {f} for {c} in ({f}, {f})])[-1]
({f}, {f}, {f})[{i} % 3]
({f}, {f})[{n} % 2]
[{f}, {f}, {f}][-1]
?sorted(({f}, {f}, {f}))[{n} % 3]
?({c} := {f})
?(({c} := {f}) + {c})
?round({f}, {n})
?round({f}, -1)
math.sin({f})
math.cos({f})
math.atan({f})
math.atan2({f}, {f})
math.tanh({f})
math.exp({f})
math.exp(100.0 * {f})
math.expm1({f})
math.log({f})
math.log(abs({f}) + 1.0)
math.log({f}, 3.0)
math.log({i})
math.log1p({f})
math.log2({f})
math.log10({f})
math.sqrt({f})
math.sqrt(abs({f}))
math.acos({f})
math.asin({f})
math.acosh({f})
math.atanh({f})
math.sinh(300.0 * {f})
math.cosh({f})
math.erf({f})
math.gamma({f})
math.lgamma({f})
math.cbrt({f})
math.hypot({f}, {f})
?math.hypot({f}, {f}, {f})
math.pow({f}, {f})
math.fmod({f}, {f})
math.remainder({f}, {f})
math.copysign({f}, {f})
math.fabs({s})
math.degrees({f})
math.radians({f})
?math.ldexp({f}, {n})
?math.modf({f})[0]
?math.frexp({f})[0]
?math.fsum([{f}, {f}, {f}])
?math.dist(({f}, {f}), ({f}, {f}))
?math.prod([{f}, {f}])
?math.nextafter({f}, {f})
math.ulp({f})
math.inf * {f}
math.nan
math.inf
-0.0
math.pi
math.e
SCALE
SCALE * {f}
self.a
self.a * {f}
t
{f} * state.dt
cube({f})
shifted({f})
shifted({f}, by={f})
shifted(by={f}, y={f})
shifted({f}, {f})
self.mixed({f}, {f})
self.mixed({f}, second={f})
?self.mixed(second={f}, first={f})
self.fed({f}) + self.fed({f})
?(lambda {c}: {c} * 2.0)({f})
?float(len(self.mode)) + {f}
float(self.mode == "fast")
?float(f"{{self.mode}}" == "fast")
?float("fa" in self.mode)
state.rng.random()
state.rng.random() - {f}
state.rng.standard_normal()
state.rng.normal({f}, 2.0)
?state.rng.normal(loc={f}, scale=0.5)
state.rng.normal(0.0, {f})
?state.rng.normal()
state.rng.uniform({f}, 3.0)
?state.rng.uniform()
?state.rng.uniform(high={f}, low=-1.0)
state.rng.uniform({f}, {f})
state.rng.exponential({f})
?state.rng.exponential()
state.rng.standard_exponential()
?state.rng.gamma(2.0)
?state.rng.lognormal(0.0, 0.5)
?state.rng.triangular(0.0, 1.0, 2.0)
self.drawn(state)
(0.0 if {b} else self.drawn(state))
?float(({f}).is_integer())
float({f} in ({f}, {f}))
?float(({i}).bit_length())
?complex({f}, {f}).imag
?abs(complex({f}, {f}))
?next(iter(({f}, {f})))
?(lambda: {f})()
?dict(y={f})["y"]
?{{"y": {f}}}["y"]
?float(str({i}))
?float("1.5")
divmod({f}, {f})[0]
divmod({f}, {f})[1]
pow({f}, {n})
pow({f}, {f})
"""

EXPRESSIONS["F"] = """
state.h[{d}]
state.h[{i} % 4]
state.h[-1]
v[{d}]
v[{i} % 4]
v[{i}]
state.g[{n} % 2, {n} % 3]
state.g[-1][0]
{A}[{d}]
{M}[1, -1]
self.p[{n} % 3]
self.changed(state)
state.h[0] * 2.0 + self.changed(state)
state.h[0] + self.changed(state) * state.h[0]
self.changed(state) - self.changed(state) * 3.0
(self.changed(state) + state.h[0]) * state.h[1]
self.swapped(state) + state.h[0] - 2.0 * state.h[1]
({F} + {F})
({F} - {s})
({s} * {F})
({F} / {s})
({s} / {F})
({F} // {s})
({F} % {s})
(-{F})
abs({F})
({F} ** 2)
({F} ** {n})
~({F} ** 0.5)
~({F} ** {f})
({F} ** -1)
?round({F}, {n})
({F} if {b} else {F})
min({F}, {f})
max({F}, {F})
?min({e}.tolist())
max({A})
min({A})
sum({A})
sum({A}, {f})
sum(state.g[0])
{A}.sum()
{A}.max()
{A}.min()
{A}.mean()
{M}.sum()
{M}.max()
np.sum({A})
np.sum({M})
?np.sum({A}, initial={f})
?np.sum({A}, where={Q})
?np.max({A}, initial={f})
?np.max({A}, initial=0.0, where={Q})
np.min({M})
np.amax({A})
np.mean({A})
?np.mean({A}, where=[True, False, True, True])
?np.prod({A})
?np.ptp({A})
?np.median({A})
?np.cumsum({A})[-1]
?np.diff({A})[0]
?np.trace({M})
~np.dot({A}, {A})
~{A} @ {A}
~np.vdot({A}, {A})
~np.vdot({M}, {M})
?~np.inner({A}, {A})
np.dot({f}, {f})
np.float64({f})
np.float64({f}) / 0
np.float64({f}) / {i}
np.float64({f}) % {f}
np.int64({i}) / {i}
np.float64({f}) ** -1
np.sqrt({s})
np.abs({s})
np.absolute({F})
np.fabs({f})
np.sign({S})
np.floor({f})
np.ceil({F})
np.trunc({f})
np.rint({F})
?np.round({f}, {n})
?np.round({F})
?np.around({F}, decimals=1)
np.minimum({f}, {F})
np.maximum({f}, math.nan)
?np.fmin({f}, math.nan)
?np.fmax({F}, {f})
np.clip({f}, -1.0, 1.0)
np.clip({F}, {f}, {f})
?np.clip({f}, None, 1.0)
?np.clip({f}, a_min=-1.0, a_max=0.5)
np.copysign({f}, {F})
np.square({f})
?np.reciprocal({F})
np.add({f}, {F})
np.subtract({F}, {f})
np.multiply({f}, {f})
np.divide({f}, {f})
?np.true_divide({f}, {F})
?np.floor_divide({f}, {F})
np.mod({f}, {f})
np.remainder({F}, {f})
np.fmod({f}, {F})
?np.negative({f})
?np.positive({F})
~np.hypot({f}, {f})
np.where({b}, {f}, {f})
?np.where({B}, {F}, {f}).item()
?np.nan_to_num({F})
?np.interp({f}, (0.0, 1.0, 2.0), (1.0, 3.0, -1.0))
?np.heaviside({f}, 0.5)
?np.sinc(0.0)
?np.deg2rad({f})
?~np.linalg.norm({A})
np.count_nonzero({Q}) * 0.5
np.argmax({A}) + 0.5
{A}.item({d})
{M}.item(1, 2)
np.asarray({f})[()]
np.array({f}) * 1.0
(np.float64({f}) > 0) * 1.5
?np.float64({f}).item()
?np.nansum({A})
?np.nanmax({A})
?np.float32({f}) * 1.0
?np.float64(np.float32({f}))
np.mean({Q})
{Q}.mean()
?np.max({A}, keepdims=True)[0]
?np.sum({M}, axis=0)[1]
?np.sum({M}, axis=1, keepdims=True)[0, 0]
?np.sum({A}, dtype=int) * 1.0
?~np.std(np.array([1.0, 3.0, {f}]))
?~np.var(np.array([1.0, {f}]))
?np.max({M}, axis=1)[0]
?np.max({M}, 0)[-1]
?{M}.min(axis=0)[2]
?{M}.mean(0)[1]
?np.average({A})
?np.argmax({M}, axis=1)[0] * 1.0
~np.exp({f})
~np.log({F})
~np.sin({F})
~np.arctan2({f}, {F})
~np.power({f}, {f})
~np.tanh({f})
~np.arccos({f})
~np.log1p({F})
~np.cbrt({F})
~np.expm1({f})
~np.exp2({f})
~np.log10({f})
~np.arcsinh({F})
~np.tan({f})
?~np.logaddexp({f}, {f})
"""

EXPRESSIONS["i"] = """
({i} + {i})
({i} - {i})
({i} * {i})
({i} * {i} * 1000003)
({i} // {i})
({i} % {i})
({i} % {n})
({i} // -{n})
(-{i})
?(~{i})
abs({i})
({i} & {i})
({i} | {i})
({i} ^ {i})
({i} << {n})
({i} >> {n})
({i} << abs({i}) % 70)
({i} >> abs({i}) % 70)
({i} ** {n})
({i} ** 2)
({i} ** (abs({i}) % 40) % 1009)
({i} ** 40 % 97)
pow({i}, {n}, 101)
pow({i}, {n})
?((6364136223846793005 * {i} + 1442695040888963407) % 2**64 >> 33)
((1103515245 * {i} + 12345) % 2**31)
(2**62 + {i}) * 4 % 1000
?(2**63 - 1 + {i}) % 1000
int({f})
int({F})
int({b})
int({A}[{d}])
round({f})
round({F})
?round({i}, -1)
round({n} + 0.5)
round({f} * 0.5)
math.floor({f})
math.ceil({f})
math.trunc({f})
?math.factorial({n} + 20) % 1000
?math.factorial(abs({i}) % 25) % 1009
?math.gcd({i}, {i})
?math.comb({n} + 10, {n})
?math.isqrt(abs({i}))
?factorial({n} + 18) % 1000
?factorial(abs({i}) % 23) % 1009
fibonacci({n})
len(v)
len({A})
len(({f}, {f}))
?len(self.mode)
len(state.g)
state.g.shape[1]
state.h.size
state.h.ndim
self.n
self.n * {i}
COUNT
COUNT - {i}
{n}
-{n}
min({i}, {i})
max({i}, {i}, {n})
({i} if {b} else {i})
({i} and {i})
({i} or {i})
({b} + {b})
({b} * {i})
({b} - {b})
(-{b})
(+{b})
(~{b})
(~({f} > 0))
sum([{b}, {b}, {b}])
sum({c} > 0 for {c} in ({f}, {f}))
sum({c} for {c} in range({n}))
sum([{c} * {c} for {c} in range({i} % 5)])
?sum(range({n}))
?sum(1 for {c} in state.h if {c} > 0)
?len([{c} for {c} in v if {c} > {f}])
?max(range({n} + 1), key=lambda {c}: -{c})
?min(enumerate(({f}, {f})))[0]
(1, 2, 3)[{i} % 3]
?(1, 2, 3).index({n} % 3 + 1)
?(1, 2, 1).count(1)
[3, 1, 2][{n} % 3]
?sorted([{i}, {i}])[0]
divmod({i}, {i})[1]
divmod({i}, {n})[0]
int(state.h[{d}] > 0)
({b} & {i})
?int("12")
int({f} // 1)
?hash({n})
?int(state.rng.integers(10))
?int(state.rng.integers(0, {n} + 1))
(3 if state.h.any() else 4)
int({Q}.sum())
?{Q}.tolist().count(True)
int(np.sign({f}))
?(lambda {c}: {c} + 1)({i})
?ord("a") + {i}
?len("abc") * {i}
(True + True) * {i}
isinstance({f}, float) + {i}
bool({i}) + 1
?({c} := {i})
?next({c} for {c} in range(3) if {c} > 0)
"""

EXPRESSIONS["I"] = """
{K}[{d}]
{K}[{i} % 4]
?{K}.sum()
np.sum({K})
sum({K})
max({K})
?{K}.max()
?{K}.min()
np.argmax({A})
np.argmin({A})
np.argmin({K})
{A}.argmax()
?np.argmax([{f}, {f}, {f}])
np.count_nonzero({Q})
np.sum({Q})
{Q}.sum()
sum({Q})
np.int64({i})
np.int64({i}) * {i}
np.int64({i}) // {i}
np.int64({i}) % {i}
np.int64({i}) ** 2
np.int64({i}) << 3
?np.int64(2**62) * 4
?np.int64(2**62) + np.int64(2**62) + np.int64({i})
(-{I})
?(~{I})
abs({I})
({I} + {i})
({I} * {I})
({i} - {I})
({I} // {I})
({I} % {n})
({I} & {i})
({I} >> 1)
({I} if {b} else {I})
?np.searchsorted((0.0, 1.0, 2.0), {f})
np.dot({K}, {K})
{K} @ {K}
?np.prod({K})
?np.cumsum({K})[-1]
?np.max({K}, initial={i})
np.int64({f})
np.array({i}) + 1
np.add({i}, {i})
np.multiply({i}, {I})
?np.floor_divide({i}, {I})
np.mod({I}, {n})
np.power({i}, 2)
np.maximum({i}, {I})
np.clip({i}, 0, 3)
np.abs({i})
np.sign({i})
np.minimum(3, {I})
np.where({b}, {i}, {i})
np.vdot({K}, {K})
?np.argsort({A})[0]
?np.bitwise_and({i}, 6)
?np.left_shift({i}, 2)
?np.negative({i})
np.square({i})
np.trunc({n}) * 1
np.ceil({i})
len(np.where({Q})[0])
?np.flatnonzero({Q}).size
?np.nonzero({Q})[0].size
?np.sum({K}, dtype=float)
({B} + {i})
({B} * {I})
"""

EXPRESSIONS["b"] = """
{f} > {f}
{f} <= {f}
{f} == {f}
{f} != {f}
{i} < {i}
{i} == {f}
{f} < {f} < {f}
0 < {f} < {f}
{f} < {f} <= {f} != {f}
0 < x < state.rng.random()
{f} < self.drawn(state) < self.drawn(state)
0.0 < x < self.changed(state) < state.h[0]
(not {b})
(not {s})
({b} and {b})
({b} or {b})
({b} & {b})
({b} | {b})
?({b} ^ {b})
({f} > 0 and self.drawn(state) > 0.5)
({b} or self.changed(state) > 0.0)
({b} and self.drawn(state) > 0.5 and self.drawn(state) < 0.5)
bool({s})
bool({A}[{d}])
True
False
self.flag
{b} == {b}
{b} is True
self.mode == "slow"
self.mode != "fast"
self.mode in ("fast", "slow")
any([{b}, {b}])
all(({b}, {b}))
any({c} > 0 for {c} in ({f}, {f}))
?all({c} < {f} for {c} in state.h)
?any({c} > 0.0 and {c} < {f} for {c} in v)
any(self.drawn(state) > {c} for {c} in (0.1, 0.5, 0.9))
math.isnan({f})
math.isinf({f} * 1e300 * 1e10)
math.isfinite({f})
?math.isclose({f}, {f})
?math.isclose({f}, {f}, rel_tol=0.1)
({b} if {b} else {b})
({f}, {f}) == ({f}, {f})
?({f}, {i}) < ({f}, {i})
{f} in ({f}, {f}, 1.5)
{i} in (1, 2, 3)
{i} not in (1, 2)
?{i} in range({n})
None is None
isinstance({s}, float)
isinstance({i}, int)
?(lambda {c}: {c} > 0)({f})
bool(self.n)
bool({i} & 1)
{f} == math.nan
-0.0 == {f}
{n}
"""

EXPRESSIONS["B"] = """
({F} > {s})
({F} == {F})
({F} != {f})
({s} <= {F})
(v[0] > 0)
(state.h[{d}] > {f})
({B} + {B})
({B} * {B})
({B} & {B})
({B} | {B})
({B} ^ {B})
({B} ^ {b})
(~{B})
(~(v[0] > {f}))
(not {B})
({I} == {i})
{Q}[{d}]
{Q}.any()
{Q}.all()
np.any({Q})
np.all({Q})
np.any({A})
np.all({A} > {f})
?np.all({Q}, axis=0)
?np.any({Q}, keepdims=True)[0]
any({Q})
all({Q})
np.isnan({S})
np.isinf({F})
np.isfinite({s})
?np.isclose({f}, {F})
?np.allclose({A}, {A})
?np.array_equal({A}, {A})
?np.logical_and({b}, {B})
?np.logical_or({F}, {b})
?np.logical_xor({B}, {b})
?np.logical_not({F})
np.bool_({b})
?np.signbit({f})
?np.less({f}, {F})
?np.equal({f}, {f})
?np.greater_equal({F}, {f})
({B} and {B})
({B} or {b})
(1.0 < v[1] < {f})
(v[0] < self.changed(state) < state.h[0])
(True if {B} else {B})
?{F} in {A}
?np.isin({f}, (1.0, 1.5))
({B} == {b})
({B} < {B})
"""

EXPRESSIONS["A"] = """
v
state.h
state.h.copy()
np.array([{f}, {f}, {f}, {f}])
np.array(({f}, {i}, {f}, {i}), dtype=float)
np.array([{i}, {i}, {i}, {i}], dtype=float)
np.array([{c} * {f} for {c} in (1.0, 2.0, 3.0, 4.0)])
np.array([{c} + {f} for {c} in range(4)])
np.asarray([{f}, {f}, {f}, {f}])
np.asarray({A})
np.asarray({A}, dtype=float)
np.array({A})
np.array({A}, dtype=int) * 0.5
np.array({A}, dtype=bool) * 1.0
?np.array({A}, copy=False)
np.asarray({A}, dtype=int) * 0.5
?np.array({A}, dtype=np.float32) * 1.0
?np.array({A}, dtype=complex).real
?np.array({A}, ndmin=2)[0]
np.copy({A})
np.ascontiguousarray({A})
({A} + {A})
({A} - {s})
({s} * {A})
({A} * {A})
({A} / {A})
({A} / {s})
({f} / {A})
({A} // {A})
({A} // {f})
({A} % {A})
({A} % {f})
({f} % {A})
({K} / {i})
({K} * {f})
({K} / {K})
(-{A})
(+{A})
abs({A})
({A} ** 2)
~({A} ** -1.0)
({A} * {K})
({A} + {Q})
({Q} * {A})
({Q} * {f})
({Q} / 2)
({A} if {b} else {A})
?state.h[::-1]
?state.h[::2].repeat(2)
?{A}[::-1]
?{A}[[3, 1, 0, 2]]
{A}[{K} % 4]
{A}[:]
{A}[...]
{A}.copy()
{A}.T
{A}.ravel()
{A}.flatten()
{A}.reshape(4)
{A}.reshape(2, 2).T.ravel()
{A}.reshape(2, 2).T.reshape(4)
?{A}.reshape((2, 2))[::-1].ravel()
?{A}.reshape(-1)
{A}.astype(float)
?{A}.astype(int) * 1.0
?{K}.astype(float)
{Q}.astype(float)
?{A}.clip(-1.0, 1.0)
?{A}.cumsum()
?{A}.round(1)
?{A}.round()
?{A}.squeeze()
?np.reshape({A}, (2, 2)).sum(axis=0).repeat(2)
np.zeros(4)
np.zeros(4) + {s}
np.zeros((4,), dtype=float)
?np.zeros(shape=4)
np.ones(4) * {f}
np.full(4, {f})
np.full((4,), {i}) * 1.0
?np.full(4, {f}, dtype=int) * 1.0
?np.full(fill_value={f}, shape=4)
np.zeros_like({A})
np.ones_like({A}) * {f}
?np.full_like({A}, {f})
?np.full_like({K}, {f}) * 0.5
np.zeros_like({K}, dtype=float)
np.arange(4) * 1.0
?np.arange(4.0)
?np.arange(1, 5) * {f}
?np.arange(0.0, 2.0, 0.5)
?np.arange(8, 0, -2) * 0.5
?np.arange(4, dtype=float)
?np.linspace(0.0, 3.0, 4)
?np.linspace(0.0, 4.0, 4, endpoint=False)
np.eye(4)[{d}]
np.eye(4, 4, 1)[0]
?np.eye(4, k=-1)[{d}]
np.eye(2, 4)[1]
np.eye(4, dtype=int)[{d}] * 1.0
np.identity(4)[{d}]
?np.diag({A})[{d}]
?np.diag({A}, 1)[0][1:]
np.sqrt(abs({A}))
np.sqrt({A})
np.abs({A})
np.sign({A})
np.floor({A})
np.ceil({A})
np.rint({A})
np.trunc({A})
?np.round({A}, 1)
?np.round({A}, decimals=-1)
np.square({A})
np.minimum({A}, {f})
np.maximum({A}, {A})
?np.fmax({A}, {f})
np.clip({A}, -1.0, {f})
?np.clip({A}, None, 1.0)
np.clip({A}, {A}, {A})
?np.clip({A}, a_min=0.0, a_max=None)
?np.clip({A}, 0.0, 1.0, where={Q}, out=np.zeros(4))
np.where({Q}, {A}, {f})
np.where({Q}, {f}, {K})
np.where({A} > 0, {A}, -{A})
np.where({b}, {A}, {A})
np.add({A}, {f})
?np.add({A}, {f}, where={Q}, out=np.zeros(4))
?np.add({A}, 1.0, out=np.ones(4))
np.multiply({A}, {A}, dtype=float)
?np.subtract.outer({A}, {A})[0]
?np.add.reduce({M}, axis=1).repeat(2)
np.divide({A}, {f})
np.mod({A}, {f})
~np.hypot({A}, {f})
np.copysign({A}, {A})
?np.cumsum({A})
?np.cumsum({K}) * 1.0
?np.cumprod({A})
?np.sort({A})
?np.roll({A}, {n})
?np.flip({A})
?np.append({A}[:2], {A}[2:])
?np.concatenate(({A}[1:], {A}[:1]))
?np.hstack(({A}[:2], {A}[2:]))
?np.vstack(({A}, {A}))[1]
?np.stack(({A}, {A}), axis=1)[:, 0]
?np.tile({A}[:2], 2)
?np.repeat({A}[:2], 2)
?np.diff({A}, prepend=0.0)
?np.diff({A}, n=1, append={f})
?np.gradient({A})
?np.outer({A}, {A})[{d}]
?np.outer({A}, {A})[:, {d}]
?({A}[:, None] * {A})[{d}]
?({A}[:, None] + {A}[None, :]).sum(axis=0)
?({A}[:, np.newaxis] - {K})[:, 1]
({A}.reshape(4, 1) * {A}.reshape(1, 4))[{d}]
~np.dot(np.eye(4), {A})
~np.eye(4) @ {A}
?~{A} @ np.eye(4, k=1)
~np.matmul(np.ones((4, 4)), {A})
?~np.einsum("i,i->i", {A}, {A})
?np.interp({A}, (0.0, 1.0), (1.0, 2.0))
?np.nan_to_num({A})
?np.nan_to_num({A}, nan=1.0)
?np.atleast_1d({A})
?np.ravel({A})
?np.transpose({A})
?np.empty(0).sum() + {A}
?np.negative({A})
?np.reciprocal({A})
?np.take({A}, [0, 2, 1, 3])
?np.select([{Q}], [{A}], {f})
?np.select([{Q}, {Q}], [{A}, 1.0])
?np.piecewise({A}, [{Q}], [1.0, 2.0])
?np.heaviside({A}, 0.5)
?np.fix({A})
?np.lib.stride_tricks.sliding_window_view({A}, 1)[:, 0]
?np.array([*{A}])
?np.array([*{A}[:2], {f}, {f}])
?np.array(list({A}))
?np.array(sorted({A}))
?np.array(tuple(map(float, {A})))
?np.array([abs({c}) for {c} in {A}])
?np.array([max({c}, {f}) for {c} in state.h])
?np.array([{c} if {c} > 0 else -{c} for {c} in v])
?np.fromiter(({c} * 2 for {c} in {A}), float)
state.rng.random(4)
state.rng.random(size=4)
state.rng.random((2, 2)).ravel()
state.rng.normal(0.0, 1.0, 4)
state.rng.normal(0.0, 1.0, size=4)
?state.rng.normal({A}, 1.0)
?state.rng.normal({A})
?state.rng.normal(size=4)
state.rng.uniform(-1.0, 1.0, 4)
?state.rng.uniform(0.0, {A})
?state.rng.uniform(size=4)
state.rng.standard_normal(4)
?state.rng.standard_normal(4, dtype=np.float32) * 1.0
state.rng.exponential(1.0, 4)
?state.rng.exponential(size=(4,))
?state.rng.permutation({A})
?state.rng.choice({A}, 4)
?state.rng.integers(0, 5, size=4) * 1.0
first_of({A}, {A})
self.doubled({A})
?self.changed_all(state)
?state.h * 2 + self.changed_all(state)
state.h + self.changed(state)
?np.stack([{A}, {A}]).max(axis=0)
?np.max(({A}, {A}), axis=0)
?np.sum(np.array([{A}, {A}]), axis=0)
?np.mean([{A}, {A}], axis=0)
?np.sum({M}, axis=1).repeat(2)
?np.atleast_2d({A})[0]
~np.exp({A})
?~np.exp({A}, out=np.zeros(4), where={Q})
~np.log({A})
~np.sin({A})
~np.arctan2({A}, {A})
~({A} ** {f})
~({A} ** 0.5)
~({A} ** {n})
~np.power({A}, 3)
~np.tanh({A})
~np.arcsin({A})
~np.log1p({A})
~np.cbrt({A})
"""

EXPRESSIONS["M"] = """
state.g
state.g.copy()
state.g * {s}
({M} + {M})
({M} * {A}[:3])
?({M} - {A}[:2, None])
({M} / {s})
(-{M})
?{M}[::-1]
?{M}[:, ::-1]
?{M}[:, [2, 0, 1]]
{M}.T.T
{M}.T.copy().T
{M}.reshape(3, 2).T
{M}.reshape(6).reshape(2, 3)
{M}.ravel().reshape(2, 3)
np.array([[{f}, {f}, {f}], [{f}, {f}, {f}]])
np.array((({f}, {i}, {f}), (1.0, {f}, 2)))
?np.array([{A}[:3], {A}[1:]])
np.asarray({M})
np.asarray({M}.T).T
np.zeros((2, 3))
np.ones((2, 3)) * {f}
np.full((2, 3), {f})
np.zeros_like({M})
np.zeros((2, 3), dtype=int) + {f}
np.eye(2, 3)
np.eye(2, 3, 1) * {f}
?np.eye(2, M=3)
np.eye(3)[:2]
?np.arange(6.0).reshape(2, 3)
?np.arange(6).reshape(2, -1) * {f}
np.where({M} > 0, {M}, {f})
np.maximum({M}, {A}[:3])
np.clip({M}, 0.0, {f})
?np.outer({A}[:2], {A}[:3])
?{A}[:2, None] * {A}[None, :3]
~np.eye(2) @ {M}
~{M} @ np.eye(3)
~np.dot(np.ones((2, 2)), {M})
?np.cumsum({M}, axis=0)
?np.cumsum({M}, axis=1)
?np.sort({M}, axis=0)
?np.flip({M}, axis=1)
?np.roll({M}, 1, axis=0)
?np.transpose({M}.T)
?np.transpose({M}, (0, 1))
?np.swapaxes({M}.T, 0, 1)
?np.vstack(({M}[0], {M}[1]))
?np.concatenate(({M}[:1], {M}[1:]))
?np.concatenate(({M}[:, :1], {M}[:, 1:]), axis=1)
?np.broadcast_to({A}[:3], (2, 3))
?np.sum({M}, axis=0) + np.zeros((2, 1))
?np.mean({M}, axis=1, keepdims=True) + {M}
?np.max({M}, axis=1, keepdims=True) - {M}
?np.tril({M})
?np.triu({M}, 1)
?np.meshgrid({A}[:3], {A}[:2])[0]
np.abs({M})
?np.round({M}, 1)
({M} > {f}) * 1.0
({M} > {f}) * {M}
state.rng.random((2, 3))
?state.rng.normal(size=(2, 3))
?state.rng.normal({M}, 1.0)
state.rng.uniform(-1.0, 1.0, (2, 3))
"""

EXPRESSIONS["K"] = """
np.array([{i}, {i}, {i}, {i}])
np.array([3, -2, 7, {i}])
np.array(({i}, {b}, {i}, {i}))
?np.array([{f}, {f}, {f}, {f}], dtype=int)
np.array({A}, dtype=int)
np.array({A}, dtype="int64")
np.arange(4)
np.arange(4) + {i}
?np.arange({n}, {n} + 4)
np.zeros(4, dtype=int) + {i}
np.zeros(4, int)
np.ones(4, dtype=np.int64) * {n}
np.full(4, {i})
np.full(4, {i}, dtype=np.int64)
({K} + {K})
({K} - {i})
({K} * {K})
({K} * 2**40)
({K} * 2**62)
({K} // {K})
({K} // {i})
({K} % {K})
({K} % {n})
({i} // {K})
({K} ** 2)
({K} ** {n})
?({i} ** np.arange(4))
({K} & {i})
({K} | {K})
({K} ^ 3)
({K} << {n})
({K} >> {n})
({K} << 63)
({K} >> {K} % 70)
(-{K})
?(~{K})
abs({K})
({Q} + {K})
({Q} * {i})
({Q} + 0)
np.where({Q}, {i}, {K})
np.where({Q}, {i}, {i})
?{A}.astype(int)
?{Q}.astype(int)
?{K}.copy()
?{K}[::-1]
{K}.T
?np.cumsum({K})
?np.cumsum({Q})
?np.argsort({A})
?np.sort({K})
np.abs({K})
np.sign({K})
np.maximum({K}, {i})
np.minimum({K}, {K})
np.clip({K}, 0, {n})
?np.floor_divide({K}, {n})
np.mod({K}, {i})
np.power({K}, 2)
np.square({K})
?np.full_like({K}, {i})
?np.full_like({K}, {f})
np.zeros_like({K})
np.ones_like({K})
np.zeros_like({A}, dtype=int)
?np.searchsorted((0.0, 1.0, 2.0), {A})
?np.digitize({A}, (0.0, 1.0))
?np.bitwise_xor({K}, {i})
?np.invert({K})
np.add({Q}, {Q}, dtype=int)
?np.diff({K}, prepend=0)
?np.prod({K}) * np.arange(4)
np.dot(np.eye(4, dtype=int), {K})
?np.outer({K}, {K})[{d}]
np.array([len(v), self.n, {i}, COUNT])
?np.array([int({c}) for {c} in {A}])
?np.round({K}, -1)
np.int64({i}) + np.arange(4)
?state.rng.integers(0, 10, 4)
?state.rng.permutation(4)
"""

EXPRESSIONS["Q"] = """
({A} > {f})
({A} > 0)
({A} == {A})
({A} != {A})
({A} <= {K})
({K} == {i})
({K} % 2 == 0)
(v > 0)
(state.h < {s})
({Q} & {Q})
({Q} | {Q})
({Q} ^ {Q})
({Q} & {b})
({Q} | {B})
({Q} + {Q})
({Q} * {Q})
({Q} + {B})
({Q} == {Q})
({Q} != {b})
(~{Q})
(~(v > {f}))
({f} < {A})
(0 <= {A})
np.array([{b}, {b}, {b}, {b}])
np.array([True, False, {b}, {B}])
np.array({A}, dtype=bool)
np.array({K}, dtype=bool)
np.zeros(4, dtype=bool)
np.ones(4, bool) & {Q}
np.full(4, {b})
?{A}.astype(bool)
{Q}.copy()
?{Q}[::-1]
np.isnan({A})
np.isfinite({A})
np.isinf({A} * 1e308)
?np.isclose({A}, {f})
?np.logical_and({Q}, {A})
?np.logical_or({Q}, {b})
?np.logical_not({A})
?np.logical_xor({Q}, {A})
?np.greater({A}, {f})
?np.less_equal({A}, {A})
?np.equal({A}, {f})
np.where({Q}, {b}, {Q})
np.where({Q}, {Q}, {b})
?np.maximum({Q}, {b})
?np.minimum({Q}, {Q})
?np.signbit({A})
?np.abs({Q})
np.zeros_like({Q})
np.ones_like({A}, dtype=bool)
?np.isin({K}, (1, 2))
np.in1d({K}, (1, 2)) if False else {Q}
?np.bitwise_or({Q}, {Q})
?np.invert({Q})
?np.any({M} > {f}, axis=0).repeat(2)[:4]
?np.sort({Q})
"""
