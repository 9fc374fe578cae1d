/* The partitioned scheme against theory, experiments and other codes: drops, dam breaks. */

/* --- a drop that falls on a floor ------------------------------------------------------------- */

/* As test_drop_impact and test_drop_draws_back, without sound: times and widths of the same
 * computations, from first contact on. */
static void test_partitioned_drop(void)
{
    static const double newtonian[4][2] = {
        { 1.58, 1.12883 }, { 2.38, 1.39293 }, { 3.18, 1.42262 }, { 3.98, 1.44785 }
    };
    gs4_material m = scene_liquid(1000, 4, 0);
    double coarse;
    m.incompressible = 1;
    physics_scheme = GS4_PARTITIONED;
    coarse = physics_drop_widths(&m, 10, newtonian, 4, 0.045);
    if (test_slow) CHECK_BETWEEN(physics_drop_widths(&m, 20, newtonian, 4, 0.015), 0, 0.4 * coarse);
    physics_scheme = GS4_EXPLICIT;
}

static void test_partitioned_drop_draws_back(void)
{
    static const double reference[4][2] = {
        { 1.56, 1.18296 }, { 2.16, 1.71899 }, { 3.36, 1.46163 }, { 3.96, 1.51675 }
    };
    gs4_material m = viscoelastic_liquid(4, 0.1, 0.02, 0);
    m.density = 1000;
    m.sound_speed = 0;
    m.incompressible = 1;
    physics_scheme = GS4_PARTITIONED;
    physics_drop_widths(&m, 20, reference, 4, 0.045);
    physics_scheme = GS4_EXPLICIT;
}

static void run_partitioned_exact(void)
{
    RUN_FULL(test_partitioned_drop);
    RUN_SLOW(test_partitioned_drop_draws_back);
}
