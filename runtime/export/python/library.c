/* What the Python module asks of a controller beside its own functions. */
#include "${name}.h"

int ${name}_size(void);
int ${name}_saved(void);
void ${name}_learn(struct ${name} *c, bool on);

int ${name}_size(void)
{
    return (int)sizeof(struct ${name});
}

int ${name}_saved(void)
{
    return ${upper}_SAVED;
}

void ${name}_learn(struct ${name} *c, bool on)
{
    ${learning}
}
