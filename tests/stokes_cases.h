/* Domains for the solve of velocity and pressure, in a box of n^3 cells with h = rho = s = 1:
 * mu is mu s/(rho h^2). Faces at the air weigh 1/2. The right-hand side is a smooth swirl with
 * white noise. */
#ifndef STOKES_CASES_H
#define STOKES_CASES_H

/* All entries i, at at[], of a place in the plane z. */
#define STOK_PLANE(box, place, z, at, i)                                  \
    for (at[2] = (z), at[1] = 0, i = gs4i_box_index(box, place, 0, 0, z); \
         at[1] < gs4i_box_length(box, place, 1); at[1]++)                 \
        for (at[0] = 0; at[0] < gs4i_box_length(box, place, 0); at[0]++, i++)

static const char *const stokes_names[] = { "blob",  "rope",   "sheet", "pool", "closed",
                                            "rooms", "porous", "spray", "coil" };
enum {
    STOKES_CASES = 9
};

typedef struct stokes_case {
    gs4i_box box;
    gs4i_tasks tasks;
    gs4i_memory memory;
    gs4i_stokes s;
    uint8_t *kind, *face[3];
    gs4_real *mass[3], *rhs[3], *u[3], *p, *e, *viscosity, *density;
    size_t cells;
} stokes_case;

static uint64_t stokes_seed;

static double stokes_random(void)
{
    stokes_seed = stokes_seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(stokes_seed >> 11) / 9007199254740992.0;
}

/* A folded sheet, three cells thick, on a floor: the distance to a wavy line. */
static int stokes_in_sheet(double x, double y, double z, double n)
{
    const double fold = 0.25 * n * sin(6.28318530718 * 2 * y / n) + 0.5 * n;
    const double slope = 0.25 * 6.28318530718 * 2 * cos(6.28318530718 * 2 * y / n);
    return y < 0.9 * n && z > 0.15 * n && z < 0.85 * n
           && fabs(x - fold) < 1.5 * sqrt(1 + slope * slope);
}

/* A coiled rope, four cells across, that hangs above its coil on a floor; turns, `pitch` apart,
 * touch here and there at 5, nowhere at 6. */
static int stokes_in_rope(double x, double y, double z, double n, double pitch)
{
    const double dx = x - 0.5 * n, dz = z - 0.5 * n, r = sqrt(dx * dx + dz * dz);
    const double turn = atan2(dz, dx) / 6.28318530718;
    const double level = y - pitch * turn - pitch * floor((y - pitch * turn) / pitch) - 0.5 * pitch;
    if (y < 0.4 * n) return (r - 0.2 * n) * (r - 0.2 * n) + level * level < 4.2;
    return pow(dx - 0.2 * n, 2) + dz * dz < 4.2 && y < 0.95 * n;
}

static int stokes_kind_at(const char *name, int n, double x, double y, double z)
{
    const double dx = x - 0.5 * n, dy = y - 0.5 * n, dz = z - 0.5 * n;
    if (strcmp(name, "blob") == 0) return dx * dx + dy * dy + dz * dz < 0.0961 * n * n;
    if (strcmp(name, "rope") == 0) return stokes_in_rope(x, y, z, n, 5);
    if (strcmp(name, "coil") == 0) return stokes_in_rope(x, y, z, n, 6);
    if (strcmp(name, "sheet") == 0) return stokes_in_sheet(x, y, z, n);
    if (strcmp(name, "pool") == 0) {
        if (dx * dx + dz * dz < 0.0144 * n * n && y < 0.7 * n) return GS4_CELL_SOLID;
        return y < 0.45 * n + 0.06 * n * sin(7 * x / n)
               || pow(x - 0.75 * n, 2) + pow(y - 0.75 * n, 2) + dz * dz < 0.0144 * n * n;
    }
    if (strcmp(name, "rooms") == 0) {
        /* shafts of 7 x 7 cells; doors where two random numbers say so */
        const int i = (int)x, j = (int)y, k = (int)z;
        const int wall = i % 8 == 7 || k % 8 == 7;
        const int door = j % 8 == 3 && (i % 8 == 3 || k % 8 == 3) && (i / 8 * 3 + k / 8 * 5) % 4;
        return wall && !door ? GS4_CELL_SOLID : j < n - 3 || (i / 8 + k / 8) % 3 == 0;
    }
    if (strcmp(name, "porous") == 0) return stokes_random() < 0.3 ? GS4_CELL_SOLID : y < 0.8 * n;
    if (strcmp(name, "spray") == 0) return stokes_random() < 0.05;
    return GS4_CELL_LIQUID;
}

/* mu of a cell: "stiff", "soft": ten spheres of 1e6 or 1e-6 times as much; "halves", "smooth". */
static double stokes_contrast(const char *name, int n, double x, double y, double z)
{
    static const double centre[10][3] = { { 0.5, 0.5, 0.5 }, { 0.3, 0.2, 0.3 }, { 0.7, 0.3, 0.2 },
                                          { 0.2, 0.3, 0.8 }, { 0.8, 0.2, 0.7 }, { 0.4, 0.6, 0.3 },
                                          { 0.6, 0.1, 0.5 }, { 0.1, 0.1, 0.5 }, { 0.3, 0.4, 0.6 },
                                          { 0.7, 0.4, 0.6 } };
    int i;
    if (strcmp(name, "halves") == 0) return x < 0.5 * n ? 1 : 1e-6;
    if (strcmp(name, "smooth") == 0) return pow(10, -4 * x / n);
    for (i = 0; i < 10 && name[0]; i++)
        if (pow(x - n * centre[i][0], 2) + pow(y - n * centre[i][1], 2)
                + pow(z - n * centre[i][2], 2)
            < 0.0075 * n * n)
            return strcmp(name, "stiff") == 0 ? 1e6 : 1e-6;
    return 1;
}

static int stokes_kind(const stokes_case *k, int x, int y, int z)
{
    const int *n = k->box.size;
    if (x < 0 || y < 0 || z < 0 || x >= n[0] || y >= n[1] || z >= n[2]) return GS4_CELL_SOLID;
    return k->kind[gs4i_box_index(&k->box, GS4I_AT_CELL, x, y, z)];
}

/* Faces across c in the order of the box. */
static void stokes_set_faces(stokes_case *k, int c)
{
    const double n = k->box.size[0];
    int at[3], z;
    size_t i;
    for (z = 0; z < k->box.size[2] + (c == 2); z++) STOK_PLANE(&k->box, 1 << c, z, at, i)
        {
            const int a = stokes_kind(k, at[0] - (c == 0), at[1] - (c == 1), at[2] - (c == 2)),
                      b = stokes_kind(k, at[0], at[1], at[2]);
            const int liquid = (a == GS4_CELL_LIQUID) + (b == GS4_CELL_LIQUID),
                      solid = (a == GS4_CELL_SOLID) + (b == GS4_CELL_SOLID);
            const double x = at[(c + 1) % 3] / n - 0.5, y = at[(c + 2) % 3] / n - 0.5;
            k->face[c][i] = (uint8_t)(solid == 2 ? GS4I_STOKES_ODD
                                      : solid    ? GS4I_STOKES_GIVEN
                                      : liquid   ? GS4I_STOKES_UNKNOWN
                                                 : GS4I_STOKES_NONE);
            k->mass[c][i] = (gs4_real)(liquid == 1 ? 0.5 : 1);
            k->rhs[c][i] =
                (gs4_real)((double)k->mass[c][i]
                           * (sin(3 * x - y) - cos(2 * y + x) + 0.6 * (stokes_random() - 0.5)));
            k->u[c][i] = 0;
        }
}

static void *stokes_alloc(size_t count, size_t size)
{
    void *p = calloc(count, size);
    if (!p) exit(3);
    return p;
}

/* A box of cells without anything, of which nothing moves yet. */
static stokes_case *stokes_reserve(const int size[3])
{
    stokes_case *k = (stokes_case *)stokes_alloc(1, sizeof *k);
    int c;
    k->memory.hook.alloc_fn = gs4i_default_alloc;
    k->memory.hook.free_fn = gs4i_default_free;
    for (c = 0; c < 3; c++) k->box.size[c] = size[c];
    k->cells = gs4i_box_count(&k->box, GS4I_AT_CELL);
    k->kind = (uint8_t *)stokes_alloc(k->cells, 1);
    k->viscosity = (gs4_real *)stokes_alloc(k->cells, sizeof(gs4_real));
    k->p = (gs4_real *)stokes_alloc(k->cells, sizeof(gs4_real));
    k->e = (gs4_real *)stokes_alloc(k->cells, sizeof(gs4_real));
    for (c = 0; c < 3; c++) {
        const size_t count = gs4i_box_count(&k->box, 1 << c);
        k->face[c] = (uint8_t *)stokes_alloc(count, 1);
        k->mass[c] = (gs4_real *)stokes_alloc(count, sizeof(gs4_real));
        k->rhs[c] = (gs4_real *)stokes_alloc(count, sizeof(gs4_real));
        k->u[c] = (gs4_real *)stokes_alloc(count, sizeof(gs4_real));
        k->s.end[c] = size[c];
        k->s.face[c] = k->face[c];
        k->s.mass[c] = k->mass[c];
        k->s.rhs[c] = k->rhs[c];
        k->s.u[c] = k->u[c];
    }
    k->s.box = &k->box;
    k->s.tasks = &k->tasks;
    k->s.memory = &k->memory;
    k->s.h = 1;
    k->s.kind = k->kind;
    k->s.viscosity = k->viscosity;
    k->s.rhs_p = k->e;
    k->s.p = k->p;
    k->s.tolerance = 1e-6;
    k->s.max_iterations = 200;
    return k;
}

/* All of mu times what `contrast` says ("": the same everywhere). */
static stokes_case *stokes_make(const char *name, int n, double mu, const char *contrast)
{
    int size[3], at[3], z, c;
    stokes_case *k;
    size_t i;
    size[0] = size[1] = size[2] = n;
    k = stokes_reserve(size);
    stokes_seed = 7;
    for (z = 0; z < n; z++) STOK_PLANE(&k->box, GS4I_AT_CELL, z, at, i)
        {
            const double x = at[0] + 0.5, y = at[1] + 0.5;
            k->kind[i] = (uint8_t)stokes_kind_at(name, n, x, y, z + 0.5);
            k->viscosity[i] = (gs4_real)(mu * stokes_contrast(contrast, n, x, y, z + 0.5));
        }
    for (c = 0; c < 3; c++) stokes_set_faces(k, c);
    return k;
}

/* Bytes of the solver that are not given back; 0. */
static uint64_t stokes_free(stokes_case *k)
{
    uint64_t left;
    int c;
    gs4i_stokes_free(&k->s);
    left = k->memory.bytes;
    for (c = 0; c < 3; c++) {
        free(k->face[c]);
        free(k->mass[c]);
        free(k->rhs[c]);
        free(k->u[c]);
    }
    free(k->kind);
    free(k->viscosity);
    free(k->p);
    free(k->e);
    free(k);
    return left;
}
#endif
