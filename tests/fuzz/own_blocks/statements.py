"""Statements that random programs are made of, and programs for what once differed.

``{new_f}`` is the name of a local variable of that type, defined from there on; ``{body}`` stands
for statements. Other places are those of the expressions in ``forms``. Forms are separated by
empty lines; one that begins with ``~`` is compared within rounding.
"""

from __future__ import annotations

RECORDS = """
r[{k}] = {f}

r[{k}] = {F}

r[{k}] = {i} % 1000003

r[{k}] = {i}

r[{k}] = {I}

r[{k}] = {b}

r[{k}] = {B}

r[8:12] = {A}

r[8:12] = {K}

r[8:12] = {Q}

{c} = {M}
r[10:16] = {c}.ravel()

r[8:12] = {e}

{c} = {e}
r[{k}] = {c}.shape[0] + {c}.sum()

r[{k}] = np.sum({M})

r[{k}], r[{k}] = {s}, {s}

?r[{k}] = str({s}) == "1.5"

?r[{k}] = repr({f}) == "0.5"

?r[{k}] = type({s}) is float

?r[{k}] = isinstance({s}, (int, np.integer))
"""

STATEMENTS = """
{new_f} = {f}

{new_f} = {f}

{new_F} = {F}

{new_i} = {i}

{new_i} = {i}

{new_I} = {I}

{new_b} = {b}

{new_B} = {B}

{new_A} = {A}

{new_A} = {A}.copy()

{new_M} = {M}

{new_M} = {M}.copy()

{new_K} = {K}

{new_Q} = {Q}

{new_f}, {new_f2} = {f}, {f}

{new_f} = {new_f2} = {f}

{new_f}, {new_i} = {f}, {i}

({new_f}, {new_f2}), {new_f3} = ({f}, {f}), {f}

?{new_f}, *{c} = {f}, {f}, {f}

?*{c}, {new_f} = ({f}, {f}, {f})

{new_F}, {new_F2}, {new_F3} = state.g[{n} % 2]

{new_f}: float = {f}

{set_f} += {s}

{set_f} -= {f}

{set_f} *= {f}

{set_f} /= {s}

{set_f} //= {f}

{set_f} %= {f}

{set_f} **= 2

{set_f} += self.drawn(state)

{set_i} += {i}

{set_i} *= {i}

{set_i} //= {i}

{set_i} %= {n}

{set_i} <<= {n}

{set_i} >>= 1

{set_i} |= {i}

{set_i} &= {i}

{set_i} ^= {i}

{set_i} **= 2

{set_b} &= {b}

{set_b} |= {b}

{set_b} ^= {b}

{set_b} = not {b}

{set_F} += {s}

{set_F} *= {F}

{set_A} += {s}

{set_A} *= {A}

{set_A} /= {f}

{set_A} -= {A}

{set_A} **= 2

{set_A} //= {f}

{set_A} %= {f}

{set_A} = {set_A} + {f}

{set_A}[{d}] = {s}

{set_A}[{i}] = {f}

{set_A}[{i} % 4] += {f}

{set_A}[1:3] = {f}

{set_A}[1:] = {A}[:3]

{set_A}[::2] = {A}[:2]

?{set_A}[::-1] = {A}

{set_A}[{Q}] = {f}

{set_A}[{Q}] *= 2

{set_A}[{Q}] += {s}

{set_A}[{Q}] = {A}[{Q}]

?{set_A}[[0, 2]] += {f}

{set_A}[np.array([3, 3, 1])] += 1.0

{set_A}[...] = {A}

{set_A}.fill({f})

?{set_A}.sort()

?np.add({set_A}, {f}, out={set_A})

?np.clip({set_A}, -1.0, 1.0, out={set_A})

?np.copyto({set_A}, {A})

?np.put({set_A}, [0, 1], {f})

?np.add.at({set_A}, [0, 0, 1], {f})

{set_K} += {i}

{set_K} *= {K}

{set_K}[{d}] = {f}

{set_K}[{d}] = {i}

{set_K}[{d}] += {n}

?{set_K}[:] = {A}

?{set_K}[1:3] = {f}

{set_K} //= {i}

{set_K} -= {b}

?{set_K} += {f}

{set_K}[{Q}] = {i}

{set_Q} &= {Q}

{set_Q}[{d}] = {s}

{set_Q} |= {b}

?{set_Q} += {Q}

{set_Q} = ~{Q}

{set_M} += {A}[:3]

{set_M} *= {s}

{set_M}[{n} % 2] = {A}[:3]

{set_M}[:, 1] = {f}

{set_M}[:, 1] += {A}[:2]

{set_M}[0, 1:] = {f}, {f}

{set_M}[1][2] = {f}

{set_M}[{i} % 2, -1] -= {f}

?{set_M}[{M} > 0] = {f}

{set_M} = {set_M}.T.T

state.h[{d}] = {s}

state.h[{d}] += {s}

state.h[{d}] += self.changed(state)

state.h[0] += self.changed(state)

state.h[0] = state.h[0] + self.changed(state)

state.h[0] -= self.changed(state) * state.h[0]

state.h[{i} % 4] *= {f}

state.h[int(self.changed(state)) % 4] += self.changed(state)

state.h[{i}] = {f}

state.h += {s}

state.h *= {A}

state.h = {A}

state.h = {f}

state.h[:] = {A}

state.h[1:] = state.h[:-1]

state.h[:-1] = state.h[1:]

?state.h[::-1] = state.h

state.h[v > 0] += 1.0

state.h[{Q}] *= {f}

state.h[{Q}] = {f}

state.h[np.where({Q})] = {f}

state.h[np.where(v > 0)[0]] += {f}

state.h[{K} % 4] = {f}

state.h[1:3] += {A}[:2]

state.h[{d}], state.h[{d}] = state.h[{d}], {f}

state.h[0], state.h[1] = state.h[1], state.h[0]

state.h[{d}] = state.h[{d}] = {f}

state.s = {s}

state.s += {s}

state.s *= {f}

state.s -= self.changed(state)

state.s[...] = {f}

state.s[()] += {f}

state.s = state.s + {f}

state.g[{n} % 2, {d} % 3] = {f}

state.g += {s}

state.g[{n} % 2] = {A}[:3]

state.g[:, {n} % 3] += {f}

state.g.T[0] += {f}

state.g.ravel()[{d}] = {f}

state.g.reshape(6)[{d}] += {f}

state.g.flat[{d}] = {f}

state.g.T.ravel()[{d}] = {f}

np.asarray(state.g[:, 1])[{n} % 2] = {f}

np.asarray(state.h)[{d}] = {f}

?np.ravel(state.g)[{d}] = {f}

np.array(state.h)[{d}] = {f}

state.g.transpose()[1, 0] = {f}

{c} = state.h
{c}[{d}] += {f}

{c} = state.h[1:3]
{c}[0] = {f}
{c} += 1.0

{c} = state.h[::2]
{c}[1] = {f}
r[{k}] = {c}.sum()

{c} = state.g[:, 1]
{c}[{n} % 2] = {f}
r[{k}] = {c}[0] - {c}[1]

{c} = np.asarray(state.g[:, 1])
{c}[0] = {f}
r[{k}] = {c}[0]

~{c} = state.g.T
{c}[2] = {f}
r[{k}] = {c}.sum()

{c} = state.g.reshape(3, 2)
{c}[1, 1] = {f}

{c} = state.g.T.reshape(6)
{c}[1] = {f}
r[{k}] = {c}.sum()

{c} = state.h[{d}]
state.h[{d}] = {f}
r[{k}] = {c}

{c} = state.h
state.h[0] = {f}
r[{k}] = {c}[0]

{c} = state.h * 1.0
state.h[0] = {f}
r[{k}] = {c}[0]

{c} = state.h[:2] if {b} else state.h[2:]
{c}[0] = {f}

if {b}:
    {body}

if {b}:
    {body}
else:
    {body}

if {B}:
    {body}
elif {b}:
    {body}

if {s}:
    {body}

if {A}[{d}]:
    {body}

if {A}.any() and {b}:
    {body}

if not {b}:
    {body}
    return {leave}

if {f} > 2.0:
    r[{k}] = math.acos({f})

if x > 1.0:
    r[{k}] = 10.0**400

if {b}:
    r[{k}] = (-8) ** (1 / 3)

if {b}:
    raise ValueError("too large")

?if {b}:
    raise ValueError(f"x is {{x}}")

?assert {f} < 100.0

?assert {b}, "must hold"

for {loop_i} in range({n}):
    {body}

for {loop_i} in range(4):
    state.h[{loop_i}] += {f}

for {loop_i} in range(3, -1, -1):
    {body}

for {loop_i} in range({n}, {n} + 5, 2):
    {body}

for {loop_i} in range(0, {i} % 6):
    {body}

for {loop_i} in range(len({A})):
    if state.h[{loop_i}] > {f}:
        continue
    {body}

?for {loop_i} in range(4):
    if {b}:
        break
    {body}
else:
    r[{k}] = {f}

for {loop_F} in state.h:
    {body}

for {loop_F} in {A}:
    {body}

for {loop_f} in ({f}, {f}, {f}):
    {body}

for {loop_f} in [{f}, {f}]:
    {body}

for {loop_i}, {loop_F} in enumerate({A}):
    {body}

?for {loop_i}, {loop_F} in enumerate({A}, 2):
    {body}

for {loop_i}, {loop_f} in enumerate(({f}, {f})):
    {body}

for {loop_F}, {loop_F2} in zip({A}, {A}):
    {body}

?for {loop_F}, {loop_f} in zip({A}, (1.0, 2.0)):
    {body}

?for {loop_F} in reversed({A}):
    {body}

?for {loop_f} in reversed(({f}, {f})):
    {body}

for {loop_f}, {loop_i} in ((1.0, 2), ({f}, {i})):
    {body}

for {loop_F} in state.h:
    state.h[1] += {f}
    r[{k}] = {loop_F}

?for {c} in state.g:
    {c} += {f}

for {c} in state.g:
    r[{k}] = {c}.sum()

for {c} in {M}:
    r[{k}] += {c}[0]

for {loop_i} in range(3):
    for {loop_i2} in range(2):
        {body}

{c} = 0
while {c} < {n}:
    {c} += 1
    {body}

?{c} = 5
while {c}:
    {c} -= 1
    if {b}:
        break
else:
    r[{k}] = {f}

{c} = 0
while True:
    {c} += 1
    if {c} > 3 or {b}:
        break

{c} = 1.0
while {c} < 100.0 and {f} < 3.0:
    {c} *= 2.5

?{c} = [{f}, {f}]
{c}.append({f})
r[{k}] = sum({c})

?{c} = [0.0] * 3
{c}[1] = {f}
r[{k}] = {c}[1]

{c} = ({f}, {f}, {i})
r[{k}] = {c}[{n} % 3]

{c} = ({f}, {f})
r[{k}], r[{k}] = {c}

?{c} = {{"one": {f}}}
r[{k}] = {c}["one"]

?{c} = None
if {b}:
    {c} = {f}
r[{k}] = -1.0 if {c} is None else {c}

if {b}:
    {c} = {f}
r[{k}] = {c}

?try:
    {body}
except ZeroDivisionError:
    r[{k}] = {f}

?try:
    r[{k}] = {f} / {f}
except ArithmeticError:
    {body}

?with np.errstate(all="ignore"):
    {body}

?del {del_any}

?match {i} % 3:
    case 0:
        {body}
    case 1 | 2:
        {body}

?match self.mode:
    case "fast":
        {body}
    case _:
        {body}

pass

?import math

?def {c}(y):
    return y + {f}
r[{k}] = {c}({f})

?def {c}():
    return x
x = {f}
r[{k}] = {c}()

?{c} = lambda y: y * {f}
r[{k}] = {c}({f})

r[{k}] = self.changed(state) + state.h[0] * self.changed(state)

r[{k}] = state.h[0] if self.changed(state) > 3.0 else state.h[1]

r[{k}] = cube(self.changed(state)) + state.h[0]

r[{k}] = max(state.h[0], self.changed(state), state.h[0])

r[{k}] = math.hypot(state.h[0], self.changed(state))

r[{k}], r[{k}] = state.h[0], self.changed(state)

r[{k}] = (state.h[0], self.changed(state))[0]

r[8:12] = [state.h[0], self.changed(state), state.h[0], x]

r[8:12] = np.array([state.h[0], self.changed(state), state.h[0], x])

r[{k}] = state.h[0] > self.changed(state)

r[{k}] = state.h[0] ** (self.changed(state) * 0.0 + 1.0)

r[{k}] = state.h.sum() + self.changed_all(state).sum()

r[{k}] = self.mixed(state.h[0], self.changed(state))

r[{k}] = -state.h[0] + self.changed(state)

r[{k}] = abs(state.h[0]) + self.changed(state)

r[{k}] = float(state.h[0]) + self.changed(state)

r[{k}] = [state.h[0] + {c} for {c} in (1.0, self.changed(state))][0]

r[{k}] = state.h[0] + self.changed(state) if {b} else self.changed(state) - state.h[1]

r[{k}] = state.h[0] and self.changed(state) and state.h[0]

r[{k}] = x if x < self.drawn(state) and {b} else self.drawn(state)
"""

# Programs whole, of several statements each, for every fault that was found and mended.
DIRECTED = """
r[0] = sum([x * x for x in (1.0, 2.0)]) + x

y = 2.0
r[0] = sum([y * x for y in (1.0, 2.0)]) + y

r[8:12] = np.array([t * x for t in (1.0, 2.0, 3.0, 4.0)])
r[0] = t

r[8:12] = np.array(v * 1.75, dtype=int)

r[8:12] = np.asarray([x, 1.5, 2.5, -x], dtype=int)

r[8:12] = np.array([x, 0.0, 2.0, x], dtype=bool)

r[7:16] = np.eye(3, 3, 1).ravel()

r[10:16] = np.eye(2, 3).ravel()

if x > 1.5:
    r[0] = math.acos(x)

r[0] = math.exp(400.0 * x)

r[0] = 10.0 ** (200.0 * x)

if x < 0.0:
    r[0] = math.sqrt(x)

r[0] = (-8.0) ** (x / 3.0)

r[0] = (v[0] > 0) + (v[1] > 0)

r[8:12] = (v > 0) + (state.h > 0)

r[0] = ~(x > 0)

k = 12345
for j in range(20):
    k = k * 6364136223846793005 + 1442695040888963407
r[0] = k % 1000

k = int(x * 4.0)
r[0] = k**40 % 97

k = 1
for j in range(1, 26):
    k *= j
r[0] = k % 1000003

k = int(abs(x) * 40.0)
r[0] = (1 << k) % 1009
r[1] = 5 >> k

r[0] = 0 < x < state.rng.random()
r[1] = state.rng.random()

state.h[0] += self.changed(state)
r[0] = state.h[0] * 2.0 + self.changed(state)

r[0] = np.vdot(state.g, state.g)

c = np.asarray(state.g[:, 1])
c[0] = x
r[0] = c[0]

r[0] = max(v[0], math.nan)
r[1] = max(state.h * math.nan)

r[0] = (-2.5 - x) ** 0.5

r[0] = v[0] / (x - x)

r[8:12] = v % 0.0

r[8:12] = np.arange(4) // int(x - x)

state.h[v > 0] += 1.0

state.h[v > 0] *= 2

r[0] = np.where(v > 0)[0].size

state.s = x

state.s += x
r[0] = state.s
"""
