/* All tests in one program: cc tests/main.c -I. -lm; once more with -DGS4_DOUBLE. See run.sh.
 * With -DGS4_FEW: `few ...` runs scenes of fuzz.c and determinism.c. */
#define GS4MPM_IMPLEMENTATION
#include "gs4mpm.h"
#ifdef GS4_TESTS_QUICK /* they compile in half the time, see run.sh */
#pragma GCC optimize("O0")
#endif
#include "test.h"
#include "scenes.h"
#include "test_order.c"
#include "test_physics.c"
#include "test_viscoelastic.c"
#include "test_heat.c"
#include "test_errors.c"
#include "test_files.c"
#include "test_surface.c"
#include "test_stability.c"
#include "test_density.c"
#include "test_volume.c"
#include "test_solid.c"
#include "test_stress.c"
#include "test_yield.c"
#include "test_poisson.c"
#include "test_stokes.c"
#include "test_symmetry.c"
#include "test_contact.c"
#include "test_partitioned.c"
#include "test_partitioned_walls.c"
#include "test_partitioned_bodies.c"
#include "test_partitioned_surface.c"
#include "test_partitioned_solids.c"
#include "test_partitioned_periodic.c"
#include "test_partitioned_flows.c"
#include "test_partitioned_exact.c"
#include "extremes.h"
#include "test_partitioned_extremes.c"
#include "test_semi_implicit.c"
#include "test_semi_long.c"
#include "test_semi_viscoelastic.c"
#include "test_semi_solids.c"
#include "test_semi_melt.c"
#include "test_semi_extremes.c"
#include "test_film.c"
#include "test_mesh.c"
#include "test_affine.c"
#include "test_estimate.c"
#include "test_reference.c"

#ifdef GS4_FEW
#undef GS4MPM_IMPLEMENTATION
#include "few.c"
#endif

int main(int count, char **values)
{
#ifdef GS4_FEW
    if (count > 1 && strcmp(values[1], "few") == 0) return few(count - 1, values + 1);
#endif
    test_arguments(count, values);
    RUN_ONCE(test_free_flight);
    RUN_FULL(test_spin);
    RUN_FULL(test_momentum);
    RUN_ONCE(test_momentum_seam);
    RUN_FULL(test_poiseuille);
    RUN_FULL(test_shear_wave);
    RUN_FULL(test_stokes_first);
    RUN_FULL_ONCE(test_couette);
    RUN_FULL(test_couette_surface);
    RUN_ONCE(test_sticky_askew);
    RUN_FULL(test_sticky_pipe);
    RUN_FULL(test_column_at_rest);
    RUN_ONCE(test_sound_speed);
    RUN(test_sharp_mirrors);
    RUN_FULL(test_drop_at_rest);
    RUN_FULL_ONCE(test_noise_after_impact);
    RUN_SLOW(test_drop_impact);
    RUN_FULL_ONCE(test_elastic_wave);
    RUN_FULL(test_channel_overshoot);
    RUN_FULL(test_elastic_couette);
    RUN(test_stress_is_paid_for_where_it_is);
    RUN_ONCE(test_stress_counts);
    RUN_ONCE(test_stress_step_work);
    RUN_ONCE(test_elastic_brief);
    RUN(test_stress_edited_euler);
    RUN_SLOW(test_drop_draws_back);
    RUN_SLOW(test_die_swell);
    RUN_FULL(test_heat_modes);
    RUN_FULL(test_heat_order_in_time);
    RUN_ONCE(test_heat_stiff);
    RUN_FULL(test_heat_pulse);
    RUN_FULL(test_heat_surface);
    RUN_ONCE(test_heat_seam);
    RUN(test_heat_periodic_mean);
    RUN_ONCE(test_heat_breakdown);
    RUN_FULL(test_heat_on_each_wall);
    RUN_FULL(test_heat_one_wall);
    RUN_FULL(test_heat_drifts);
    RUN_FULL(test_heat_around);
    RUN_ONCE(test_heat_walls);
    RUN_FULL_ONCE(test_heat_bounds);
    RUN_FULL(test_heat_long_steps);
    RUN_FULL(test_heat_beside_walls);
    RUN_FULL(test_heat_waves_at_walls);
    RUN_FULL(test_heat_stefan);
    RUN_FULL(test_heat_conserved);
    RUN_FULL(test_heat_cycles);
    RUN_FULL(test_heat_of_viscosity);
    RUN_FULL(test_heat_slowly);
    RUN_FULL(test_phase_freezing);
    RUN_FULL(test_phase_melting);
    RUN_ONCE(test_phase_between);
    RUN_ONCE(test_phase_forgets);
    RUN_ONCE(test_heat_rims);
    RUN_ONCE(test_heat_full_box);
    RUN_FULL(test_heat_extremes);
    RUN(test_heat_glass);
    RUN(test_heat_not_converged);
    RUN_ONCE(test_heat_poured);
    RUN_FULL(test_heat_uneven_steps);
    RUN_FULL(test_heat_draws);
    RUN_FULL(test_heat_partitioned);
    RUN_FULL(test_heat_semi_implicit);
    run_solid();
    run_errors();
    run_files();
    run_surface();
    run_stress();
    run_yield();
    run_poisson();
    run_stokes();
    run_symmetry();
    run_contact();
    run_partitioned();
    run_partitioned_walls();
    run_partitioned_bodies();
    run_partitioned_surface();
    run_partitioned_solids();
    run_partitioned_periodic();
    run_partitioned_flows();
    run_partitioned_exact();
    run_partitioned_extremes();
    run_semi_implicit();
    run_semi_long();
    run_semi_viscoelastic();
    run_semi_solids();
    run_semi_melt();
    run_semi_extremes();
    run_film();
    run_mesh();
    run_affine();
    run_estimate();
    RUN_ONCE(test_reference);
    RUN_FULL(test_stability);
    RUN(test_stability_by_hand);
    RUN(test_stability_names);
    RUN(test_stability_of_turning);
    RUN_FULL(test_stability_of_blades);
    RUN_ONCE(test_stability_of_two_densities);
    RUN_FULL(test_extremes);
    RUN(test_safe_slopes);
    RUN(test_cells_together);
    RUN_FULL(test_short_decay);
    RUN(test_tiny_step);
    RUN(test_thickening);
    RUN(test_thickening_within_a_step);
    RUN(test_nozzle_from_outside);
    run_density();
    run_volume();
    RUN_FULL(test_order_as_printed);
    RUN(test_order_in_time);
    return test_finish();
}
