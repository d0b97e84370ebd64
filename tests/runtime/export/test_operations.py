"""Operations of exported C: counted by hand, and followed through arguments and results."""

from __future__ import annotations

import re

from runtime.export.operations import counter

PRODUCT = """
static struct pair product(struct context *ctx, double *a, int64_t a_n0, int64_t a_n1, double *b)
{
    const int64_t n = array_size(ctx, a_n0, 1);
    const int64_t last = int_subtract(ctx, a_n1, 1, 2);
    for (int64_t i = 0; i < n; i++) {
        for (int64_t k = last; k > -1; k--) {
            total += a[i * a_n1 + k] * b[k];
        }
    }
    if (!fine) {
        return (struct pair){NULL, 0};
    }
    return (struct pair){a, n};
}
static double step(struct context *ctx, const struct entries *self, double *a)
{
    const int64_t size = self->size;
    const struct pair first = product(ctx, a, size, 3, a);
    const struct pair second = product(ctx, first.v0, first.v1, size, a);
    while (more) {
        total = total / 2.0;
    }
    return total;
}
"""


def test_loops_over_constant_sizes_are_counted() -> None:
    found = counter(PRODUCT).of("step", {"size": 4})
    # A product and a sum in each pass: 4 x 3 in the first product, 4 x 4 in the second.
    assert found.arithmetic == 2 * (4 * 3 + 4 * 4)
    assert (found.divisions, found.open_loops) == (1, 1)


def test_a_loop_of_unknown_length_is_one_pass() -> None:
    found = counter(PRODUCT).of("step")
    # Each outer loop is one pass; the first inner one has three, the second one.
    assert found.arithmetic == 2 * (3 + 1)
    assert found.open_loops == 1 + 1 + 2


def test_a_function_that_calls_itself_is_counted_once() -> None:
    text = re.sub(r"while \\(more\\)", "while (step(ctx, self, a))", PRODUCT)
    assert counter(text).of("step", {"size": 4}).arithmetic == 56


FOUND = """
static struct pair found(struct context *ctx, const int64_t *marks, int64_t marks_n0)
{
    int64_t count_1_ = 0;
    int64_t *const array_1_ = take(ctx, 8 * marks_n0, 2);
    for (int64_t i_1_ = 0; i_1_ < marks_n0; i_1_++) {
        const bool marked_1_ = marks[i_1_] != 0;
        array_1_[count_1_] = i_1_;
        count_1_ += marked_1_;
    }
    const int64_t found_1_ = count_1_;
    return (struct pair){array_1_, found_1_};
}
static double step(struct context *ctx, const struct entries *self, const int64_t *marks)
{
    const int64_t size = self->size;
    const struct pair few_1_ = found(ctx, marks, size);
    const int64_t few_n0 = few_1_.v1;
    const int64_t at_1_ = clamped(few_n0 - 2, few_n0);
    const int64_t left_1_ = not_negative(size - at_1_);
    double *const array_2_ = take(ctx, 8 * few_n0, 3);
    double *const array_3_ = take(ctx, 8 * left_1_, 3);
    for (int64_t j = 0; j < few_n0; j++) {
        array_2_[j] = 2.0 * marks[j];
    }
    return total;
}
"""


def test_what_depends_on_data_is_bounded_by_what_it_is_found_in() -> None:
    found = counter(FOUND).of("step", {"size": 5})
    assert (found.is_open, found.open_loops) == (False, 0)
    # The places, what is computed of them, and what is left beside none of them.
    assert found.reserved == 3 * 5 * 8
    assert counter(FOUND).of("step").is_open
