/* What a page calls: the simulation, and the rows that its plots show. */
#define EXPORT(name) __attribute__((export_name(name), used))
#define ROWS 2048

static struct ${name} simulation, saved;
static struct ${name}_inputs in;
static double rows[ROWS * ${width}];

EXPORT("init") void page_init(void)
{
    ${name}_init(&simulation);
}

EXPORT("parameters") double *page_parameters(void)
{
    return (double *)&simulation.parameters;
}

EXPORT("inputs") double *page_inputs(void)
{
    return (double *)&in;
}

EXPORT("rows") double *page_rows(void)
{
    return rows;
}

/* Do ticks until there are enough, a failure, or no room for rows; returns the number of rows. */
EXPORT("advance") int page_advance(int ticks, int every)
{
    static struct ${name}_outputs out;
    int count = 0;
    for (int i = 0; i < ticks && count < ROWS && !simulation.failure; i++) {
        const int64_t k = simulation.tick;
        ${name}_step(&simulation, &in, &out);
        if (simulation.failure && simulation.failure != ${stopped}) break;
        if (k % every && !simulation.failure) continue;
        double *const row = rows + count++ * ${width};
        row[0] = (double)k * ${dt};
${copies}
    }
    return count;
}

EXPORT("tick") double page_tick(void)
{
    return (double)simulation.tick;
}

EXPORT("failure") int page_failure(void)
{
    return simulation.failure;
}

EXPORT("message") const char *page_message(void)
{
    return ${name}_message(simulation.failure);
}

EXPORT("save") void page_save(void)
{
    saved = simulation;
}

EXPORT("restore") void page_restore(void)
{
    simulation = saved;
}
