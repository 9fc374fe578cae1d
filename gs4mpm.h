/* gs4mpm.h - thick liquids in 3D by the Material Point Method, second order in time. 0.1.0
 * One file, libc and libm. MIT licence, at the end of the file; what changed stands before it.
 *
 * USE. In one C or C++ file of your program:
 *
 *     #define GS4MPM_IMPLEMENTATION
 *     #include "gs4mpm.h"
 *
 * and everywhere else the include alone. A whole program (cc drop.c -lm), which drops honey on a
 * floor and writes what it looks like after a quarter of a second as a point cloud:
 *
 *     #include <stdio.h>
 *     #define GS4MPM_IMPLEMENTATION
 *     #include "gs4mpm.h"
 *     int main(void)
 *     {
 *         gs4_sim_desc desc = { { 32, 32, 32 }, 0.004f };   // 32^3 cells of 4 mm: a box of 13 cm
 *         gs4_vec3 centre = { 0.064f, 0.08f, 0.064f };
 *         gs4_material honey;
 *         gs4_fill fill = { 0 };
 *         gs4_sim *sim;
 *         desc.gravity.y = -9.81f;
 *         if (gs4_create(&desc, &sim) < 0) return puts(gs4_last_error(NULL)), 1;
 *         gs4_material_preset("honey", &honey);
 *         fill.material = gs4_add_material(sim, &honey);
 *         gs4_add_particles(sim, gs4_sphere(centre, 0.03f), &fill);
 *         if (gs4_advance(sim, 0.25f) < 0 || gs4_write_ply(sim, "honey.ply") < 0)
 *             puts(gs4_last_error(sim));
 *         gs4_destroy(sim);
 *         return 0;
 *     }
 *
 * WHAT IT DOES NOT DO, YET. The semi-implicit scheme is declared and refused with a sentence; so
 * are, with the partitioned scheme, separating colliders.
 * It has no surface tension, no two-way coupling to colliders, no domain beyond
 * 3992^3 cells.
 *
 * MAP. Sections carry a tag; grep -n '^/. ==== ' gs4mpm.h is the table of contents. A section uses
 * only sections above it.
 *
 *     [[config]]    version, precision, linkage      [[base]]      arithmetic, memory, text, tasks
 *     [[types]]     results, vectors, shapes, hooks  [[vec]]       three-vectors and shapes
 *     [[materials]] what matter is                   [[poisson]]   multigrid on a masked grid
 *     [[sim]]       description, scene, stepping     [[krylov]]    conjugate gradients
 *     [[poisson]]   the elliptic solver by itself    [[kernel]]    quadratic B-splines on 27 nodes
 *                                                    [[grid]]      blocks of nodes near material
 *                                                    [[box]]       dense box of cells around them
 *                                                    [[elliptic]]  one scalar equation on the box
 *                                                    [[particles]] the store, and how it is sorted
 *                                                    [[liquid]]    pressure, viscosity, presets
 *                                                    [[viscoelastic]] non-local stress
 *                                                    [[solid]]     elastic and plastic solids
 *                                                    [[heat]]      temperature, melting, flux
 *                                                    [[response]]  all laws for a velocity gradient
 *                                                    [[boundary]]  walls by mirror nodes, colliders
 *                                                    [[state]]     what a simulation is
 *                                                    [[transfer]]  particles to nodes and back
 *                                                    [[sticky]]    image particles behind colliders
 *                                                    [[explicit]]  the scheme: S3 to S7
 *                                                    [[staggered]] velocities on faces
 *                                                    [[partitioned]] the scheme with a projection
 *                                                    [[conduction]] heat from node to node
 *                                                    [[scene]]     what is given to it; emitters
 *                                                    [[step]]      one step: gs4i_make_step
 *                                                    [[files]]     frames and checkpoints
 *                                                    [[public]]    values checked, then the work
 *
 * UNITS AND CONVENTIONS. SI, or any consistent system. L_ij = dv_i/dx_j, D = (L + L^T)/2.
 * Stresses are Cauchy, tension positive. Nodes are cell centres, x fastest; walls lie on the faces
 * of the outer cells. J = rho0/rho is the volume ratio. A prime of time: y~ is y at the stage.
 *
 * WORDS
 *     block           4^3 nodes; only blocks within reach of particles exist
 *     slot            number of a block that has nodes
 *     tile            the 8^3 nodes that the particles of a block can touch
 *     batch           16 particles side by side in vector lanes
 *     stage           t_n + alpha_f dt, where right-hand sides are evaluated
 *     integrator      the coefficients of rule (4) for one step
 *     prediction      how far the stage is ahead
 *     scheme          what turns the state of particles into acceleration of nodes
 *     response        stress, viscosity and stiffness for a velocity gradient
 *     material constants, solid phase    what laws need of a material; the same while it is solid
 *     deconvolution   taking the transfers' own smoothing out of a field (sharp_gradients)
 *     fill fraction   mass of a node over that of a node in the midst of the material
 *     mirror node     node behind a wall, which continues the field of the inner node before it
 *     parity          how a field continues there: even, odd, or odd about a value
 *     collider        a shape that moves and turns and acts on nodes and particles
 *     image particle  reflection of a particle behind the surface of a sticky collider
 *     emitter         a shape that is kept full of flowing material
 *     row             a line of places in an emitter, along its flow
 *     jump            velocity that contact gives a node at once; never part of a rate
 *     remembered acceleration (ag)    what a node keeps of acc from step to step
 *     sub-grid velocity    V - v~: what the grid does not see of a particle's velocity
 *     decay           of the sub-grid velocity, and of the same of J, a rate
 *     noise           sub-grid motion of neighbours against each other, as after an impact
 *     spin            angular velocity of a particle of a solid
 *     position residual    v - shift a - dx/dt, small: how dx/dt is kept
 *     trial pass      S7 without writing, for blocks that nodes cannot prove safe
 *     left the tile   said of particles too far from their block: sort and scatter again
 *     pocket          part of the liquid in the elliptic solver that nothing holds
 *
 * MODEL
 *     dv/dt = div sigma / rho + g,   dJ/dt = J div v,   dx/dt = v                              (1)
 *     sigma = -p I + 2 F_v mu D + S + s_F                                                      (2)
 *     p = (rho0 c0^2 / 7) (J^-7 - 1)                     Tait, weakly compressible             (3)
 *
 * mu is a constant, Cross-WLF, Herschel-Bulkley (8), or a callback of temperature and shear rate
 * sqrt(2 D:D). Without heat the temperature is that of the air. F_v is 1 for Newtonian liquids.
 * Else S, the non-local stress, is what Oldroyd-B (UCM at F_v 0) or the extended Pom-Pom model say,
 * with G0 = (1 - F_v) mu / lambda_b, r = lambda_b/lambda_0s, Lam = sqrt(1 + tr S/(3 G0)):
 *
 *     dS/dt = L S + S L^T + 2 G0 D - [f S + G0 (f - 1) I + (alpha/G0) S.S] / lambda_b          (5)
 *     f = 2 r exp((2/Q) (Lam - 1)) (1 - 1/Lam) + (1 - alpha tr(S.S)/(3 G0^2)) / Lam^2
 *     Oldroyd-B: f = 1, alpha = 0
 *
 * S goes by rule (4) where the step resolves it. Elsewhere it goes by a split that keeps the
 * conformation S/G0 + I positive definite, in as many substeps as it takes (stress_substeps).
 * With alpha > 1 equation (5) itself blows up. There, and only there, eigenvalues of the
 * conformation below 1 - 1/alpha relax without the term of alpha, none relaxes to less, and none
 * exceeds 1e6 (stress_bounded).
 *
 * Herschel-Bulkley liquids flow where the stress is above their yield stress. Here they are
 * regularised, so that viscosity at rest is finite, and the law is that of Newton far below
 * creep_rate:
 *     mu = yield_stress / e + consistency e^(index - 1),   e^2 = 2 D:D + creep_rate^2          (8)
 * What should stand creeps. Under the share s of the yield stress it does so by creep_rate s /
 * sqrt(1 - s^2), where the consistency counts little, and a plug of the half width w moves faster
 * by w creep_rate. Steps follow viscosity at rest, about yield_stress / creep_rate: half the creep
 * costs twice the steps. In channels of the half width h, plug and flux differ from those without
 * (8) by less than 2 % of steady ones where creep_rate is 1 % of (rho g h / consistency)^(1/index),
 * 0.5 % at the index 0.5; in start-up too. Slumps stop within 3 % of the length that balance of
 * weight, floor and tension of the plug gives, and creep on from there (tests/test_yield.c).
 *
 * Solids have s_F, of the elastic deformation gradient F with det F = J, B = J^(-2/3) F F^T and
 * V^2 = B:
 *     dF/dt = L F,   neo-Hookean: s_F = (G/J) dev(B),   fixed-corotated: s_F = (2 G/J) dev(B - V)
 *                                                                                              (6)
 * The pressure is (3) with the same J; viscosity damps (Kelvin-Voigt). Where a solid yields, the
 * singular values of F are clamped to [1 - yield_compression, 1 + yield_stretch] after each step
 * and scaled to det F = J again. So F is what is elastic of the deformation. Without such a limit
 * they stay within 1/512 and 512 (stress_bounded). (3) holds no tension beyond rho0 c0^2 / 7: a
 * solid under more needs a higher sound_speed than the default, or it tears.
 *
 * Heat, in scenes with a material that conducts, melts or is heated by viscosity. tau is the stress
 * without the pressure, t_q = flux_relaxation_time:
 *     rho c dT/dt + div q = tau : D,   q = -F_T k grad T + q_NL                                (7)
 *     q_NL + t_q (dq_NL/dt - L q_NL) = -(1 - F_T) k grad T
 *
 * Enthalpy is c T + latent heat times liquid fraction. A material that can melt keeps T_m while its
 * latent heat comes or goes. It becomes liquid when all is there and solid when all is gone. Solid
 * it has s_F alone beside the pressure, liquid mu and S; F begins anew without strain.
 * Temperatures are on any scale; those of presets and of the default Cross-WLF are degrees Celsius.
 * Walls, colliders and air are insulated or isothermal. Two pieces of material less than two cells
 * apart conduct heat to each other, as they hold each other. Below its t2 Cross-WLF has no value: a
 * step that asks for one is refused; with T_m above t2 none does.
 *
 * TIME. Every quantity y of a particle is kept with its rate r. 0 <= rho_sp <= rho_inf <= 1 choose
 * the member of the GS4 family: rho_inf is what high frequencies keep per step, rho_sp the same of
 * the spurious root (rho_inf_spurious). (0, 0) damps most and is the default.
 *     alpha_m = (3 + rho_inf + rho_sp - rho_inf rho_sp) / (2 (1 + rho_inf) (1 + rho_sp))
 *     alpha_f = 1 / (1 + rho_inf),   gamma = 1 / (1 + rho_sp)
 *
 *     predict    y~ = y + alpha_f dt r                                                         (4)
 *     evaluate   R at y~
 *     correct    dr = (R - r) / alpha_m;   y += dt r + gamma dt dr;   r += dr
 *
 * The rate belongs to t + (1/2 - gamma) dt. The first step, and the first after an edit, has
 * alpha_m = gamma = 1, alpha_f = 1/2 and no rates; alpha_f of heat is 1 - h^2/(D dt), if that is
 * more, D = k/(rho c). Where R depends on y~ itself, linearly, (4) is solved for it:
 *     (y~ - y**) / s = R(y~),   y** = y + (alpha_f dt - s) r,   s = alpha_f gamma dt / alpha_m
 *
 * THE STEP, as in gs4i_make_step:
 *     S1  sort particles by block of 4^3 cells, when one has left the tile of its block
 *     S2  x~, v~ by (4); quadratic B-spline weights w at x~
 *     S3  m_i = sum w m,   v_i = sum w m v~ / m_i;   solids: v~ + spin~ x (x_i - x~)
 *     S4  V = sum w v_i;   L~ = sum v_i (x) grad w;   J~ by (4), implicit in J for known div v;
 *         S~ by (4), (5);   F~ by (4), (6);   sigma there by (2), (3)
 *     S5  f_i = - sum V_p sigma grad w + sum w m g
 *         heat: (m c)_i, (m c T**)_i;   then (m c)_i (T~_i - T**_i) / s = (7) at T~, an elliptic
 *         solve ([[conduction]])
 *     S6  acc_i = f_i / m_i;   u_i = v_i + s (acc_i - ag_i);   ag_i += (acc_i - ag_i) / alpha_m;
 *         walls and colliders
 *     S7  A = sum w acc_i, U = sum w u_i. By (4):
 *         dv/dt = A - (1/flip_decay_time + k_n) (v~ - V),   dx/dt = U,   J, S, F with L = grad u,
 *         dT/dt = sum w (T~_i - T**_i) / s,
 *         dspin/dt = curl(A - grad u grad u)/2 - (1/flip_decay_time + k_n) (spin - curl u/2)
 *     S8  colliders move, emitters give, particles that left are dropped
 *
 * With sharp_gradients L~ and grad u are those of Z v_i and Z u_i, U is of Z u_i, and
 * f_i = - Z^T sum V_p sigma grad w + sum w m g, with Z as in [[grid]]. The decay takes little from
 * motion that the grid does see: as much as a kinematic viscosity of h^2 / (4 flip_decay_time). It
 * takes no momentum: sum m V = sum m v~.
 *
 * NOISE. After an impact J differs from particle to particle, which pushes them to and fro for as
 * long as it does, while the grid sees little of it. flip_decay_time cannot cure that: the pushes
 * last, and short times damp what the grid sees. So by default noise decays as fast as it
 * crosses cells itself, and in 0.5 s else. With Jbar = 1 + sum w K_i/K, K = rho0 c0^2/7,
 * K_i = sum w m K (J~ - 1) / m_i:
 *     k_n = |v~ - V| / h,   f_i gets sum w m k_n (v~ - V),
 *     dJ/dt gets k_J (Jbar - J~),   k_J = k_n + max(0, c0 |Jbar - J~| / h - |g| / c0)
 *
 * Both vanish where flow is smooth, faster than the error of the transfers. The force returns what
 * the decay takes, so momentum stays, and motion that the grid sees comes back to its particles.
 * The last term leaves alone what weight makes of J. Neither decays so in scenes with solids, whose
 * bounces would lose by it, nor where flip_decay_time is given; nor does J with sharp_gradients or
 * a material of more than twice, or less than half, the density or stiffness (rho0 c0^2) of the
 * first. A cylinder 8 cells across, 0.3 s after it fell flat at 1.7 m/s: rms and fastest of its
 * particles over that; a ball of 12 cells that spins by a radian:
 *     flip_decay_time       default       0.5 s         0.05 s        0.005 s       INFINITY
 *     noise                 0.023, 0.09   0.11, 0.52    0.05, 0.17    0.013, 0.04   0.13, 0.65
 *     spin kept             0.935         0.936         0.552         0.008         0.996
 *     order of v in time    1.97-2.01     1.97-2.00 (0.2 s)                         1.96-2.01
 *
 * VOLUME. Violent flow packs particles more densely than J says, most at floors: a tank had 0.935
 * of its right depth after 16 jolts. So where J f > 1.08, f = sum w m_i / (rho0 h^3) around a
 * particle with mirror nodes as full as inner ones,
 *     dJ/dt gets c0/(200 h) (max(1.08/f, 0.9) - J~), at most 0,
 * with both explicit integrators, and pressure makes room: the depth is 0.998, after 100 jolts
 * 0.988. Fresh fillings have J f up to 1.03; they, smooth flow and surfaces stay below 1.08 and are
 * left alone, films and spray too. Not so in scenes with solids, with sharp_gradients or with
 * densities that differ by more than 1 %, nor within reach of sticky colliders.
 *
 * In detail, as tests/reference_step.h has it in plain loops:
 *     S3  sqrt(2) |spin~| dt (Euler: |C| dt) counts by at most 1/4.
 *     S4, S7  Of F it is M = (dF/dt) F^-1 that goes by (4). F <- (I - X/2)^-1 (I + X/2) F with
 *         X = dt (M + gamma dM), then F is scaled to det F = J; at the stage
 *         X = alpha_f dt M + s (L~ - M), unscaled.
 *     S6  A node that was empty has ag_i = acc_i; in a first step ag_i = 0; mirror nodes in contact
 *         have none. s (acc_i - ag_i) counts smoothly from 0 where a node is filled by 10 % to 1 at
 *         43 %, by the lightest material of the scene: acceleration of nearly empty nodes jumps.
 *     S7  With k = 1 / flip_decay_time the rate of decay is k (1 + x)/(1 + x + x^2),
 *         x = k dt (3 + rho_inf + rho_sp - rho_inf rho_sp)/(3.2 (1 - rho_inf rho_sp)), up to which
 *         (4) is stable. Where k dt > 1 there is no such rate: 1 - 1/(1 + s k) of V - v~ goes at
 *         once. Spin decays at k, implicit in itself.
 *     S7  Near walls and in spray dv/dt has k2 (U - v) more, implicit in v. k2 = c0/h times the
 *         weight of mirror nodes plus 1 where the particle sees nodes filled by less than 8 %,
 *         smoothly to 0 at 20 %; c0 the largest of the scene.
 *     S7  k_n and k_J are taken as k above is, k_n together with it. J~ of S4 counts the decay of
 *         the last step.
 *     S7  Relaxation of S is implicit. In a first step it starts from S~ + alpha_f dt R; members
 *         with gamma <= 0.66 repeat it five times.
 *     dx/dt is kept as v - shift a - dx/dt, small, in half the width of gs4_real.
 *
 * The spin is there because nodes at a surface see particles on one side of them alone, so too slow
 * a velocity where a solid turns. What is missing strains it: without spin a stiff cube lost 20 %
 * of its kinetic energy in a quarter of a turn, with it 0.02 %.
 *
 * THE PARTITIONED SCHEME has pressure from a solve, so that no step follows sound: for liquids of
 * any bulk modulus, `incompressible` too. Velocities are on faces of cells, one component each, and
 * particles give momentum affinely, m (v~ + C (x_f - x~)), C = grad u~ extrapolated to the stage;
 * x~ has (alpha_f dt)^2/2 dv/dt more than (4), or long steps would drive waves of surfaces.
 *     acc = (forces of stress)/m + g - grad p/(w rho),   u~ = v_i + s (acc - ag)
 *     p + s K div u~ = -K (J** - 1);   div u~ = 0 where K is infinite
 * Cells are liquid where material fills more than 51.5 % of their kernel. p is 0 where the surface
 * is: w is its distance from the centre of the liquid cell before it, in cells, found from how full
 * both are. dJ/dt has div u~ - (h^2/4) lap div u~: what transfers of J smooth away, so that sound
 * is within 1.5 % at 20 cells a wave and dt = h/(2 c). Longer steps damp it: c dt/h = 30 within
 * six. Beyond liquid three layers of faces have u~ and acc by linear extrapolation, P; forces of
 * stress there, and masses, act on the faces that those go on from, P^T m P acc = P^T f. So stress
 * takes no momentum, and its angular momentum is off by some 1e-3. Particles without liquid around
 * fly by themselves. Where K is infinite acc is split, as (u~ - v**)/s alone has what scattering
 * and gathering do not invert, times 1/s, and does not converge in time:
 *     (u~ - v**)/s = acc + grad phi/(w rho),  div acc = tr(L L),  L = grad u~
 * acc makes rates and ag. theta = min(1/2, s U/h) of the rest, U the largest speed, moves particles
 * alone. Scenes with slippery colliders have plain rates, as those of finite K: what div acc is at
 * such surfaces is not known well enough. At last positions move by dt u_c, div u_c = e U/h, e how
 * much too full a cell is (at a surface what is above a tenth), at most h/10: that keeps particles
 * apart and gives no energy. Sticky colliders hold the faces whose centres are inside, to first
 * order; slippery ones close the share of a face that is inside. A separating wall holds what moves
 * into it or pressed on it in the last step; where the solve finds that it would have to pull, it
 * lets go, p is 0 on it, and what moves into it is held, at most three times a step, each a scatter
 * and a solve more. What is held by its impact alone has theta = 1/2, with finite K too.
 *
 * Symplectic Euler, the fast tier: one affine scatter with stress and one gather (MLS-MPM, APIC),
 * first order.
 *
 * SAFETY. Before S7 nothing of the state has changed. If a particle would leave 1/16 < J < 256,
 * move more than two cells or become non-finite, the step is refused and the last good state stays.
 * Most blocks need no trial pass to know, by this lemma:
 *     In a particle of mass m_p node i has weight at most m_i/m_p, and a gradient of at most
 *     sqrt(2 m_i/m_p)/h along each axis; the gradients of 27 nodes sum to at most 2/h. Let
 *     q_i = min(1, 14 sqrt(m_i/m_min)), r any velocity, |.|_1 the sum over axes. Nodes with q_i = 1
 *     give h |div u| <= 2 max |u_i - r|_1, lighter ones 27 sqrt(2)/14 max q_i |u_i - r|_1. So
 *     h |div u| <= 4.7 max q_i |u_i - r|_1 over the nodes around the block.
 * A block is safe where that bound gives |div u| dt < 0.2, the mean velocity moves less than a
 * cell, 1/4 < J < 4, and no particle needed the split.
 *
 * WALLS. A wall lies between the nodes -1 and 0 of its axis; behind it mirror nodes continue the
 * field of the inner nodes, node -1 - k that of node k:
 *
 *          mirror nodes        |        inner nodes
 *        o --------- o ------- | ------- o --------- o --------- o
 *       -2          -1       wall        0           1           2
 *      u = -u_1    u = -u_0    0        u_0         u_1               stick: odd in all components
 *                                                                     slip: odd along the normal,
 *                                                                           even along the wall
 * What particles scatter to mirror nodes is folded back to the inner ones by the same parity. So
 * walls are second order in space. Mass folds as it is; walls are filled in the reverse order of
 * folding. A separating wall acts as slip while material moves into it or
 * presses on it, and is not there otherwise, nor where material leaves with ten times the impulse
 * of its push in a step. Behind a periodic wall a field goes on a period away; colliders do not.
 *
 * COLLIDERS. Sticky ones act by image particles, second order in space where particles fill the
 * space up to the surface. A filling that leaves out half a row puts the wall up to 0.8 cells
 * behind it (tests: couette). Where they are thinner than 3 cells or as crooked as that, they hold
 * nodes up to 3/4 of a cell before the surface, to first order: liquid spins down in such a pipe as
 * in one narrower by 3/4 to 1 cell (tests: sticky_pipe). A layer at the surface that is much
 * thinner than a cell takes half a cell to a cell more, whatever holds it. Where another sticky
 * body or wall is within 3 cells they hold only nodes inside, so that liquid between can get out of
 * the way.
 * Of slip and separate ones nodes inside lose the inward relative normal part (separate with
 * Coulomb friction, which brings what it can hold to rest in one to two steps). What a collider
 * takes from a node at once is a jump: it goes to the velocities of particles, not into their
 * rates. Near sticky ones, without solids and with a finite flip_decay_time, it takes none farther
 * than to V. Before sticky ones that move, k_n of NOISE is c0/h more, or 500 |v|/h if that is less,
 * v their velocity, within a cell, and none from three on: else particles went at up to 1.7 |v|
 * (tests: contact_pairs). A particle that ends inside a collider or behind a wall is put back on
 * the surface.
 * Where the grid sees little of a particle its sub-grid velocity decays at the rate c0/h: at a wall
 * by the weight of mirror nodes, at a sticky collider by that of nodes inside or held, and in spray
 * that fills nodes by less than 20 %.
 *
 * ACCURACY (tests/test_order.c and tests/test_physics.c hold these)
 *     order in time 1.9 to 2.15 in x, v, J, F, 1.86 to 2.16 in T, q (a rest of first order shows in
 *     T below 1e-6); elastic waves within 1.3 % at 32 cells a wave (tests/test_solid.c); order in
 *     space 2.0 for Poiseuille flow, 1.95 with (8), 2.0 to 2.15 for heat, whose modes are off by up
 *     to 0.16 % of their first amplitude at 32 cells a wave (tests/test_heat.c); sound within 1.5 %
 *     at 32 cells a wave; a melting front within 0.3 cells; heat in an insulated box conserved to
 *     the tolerance of the solver; temperatures beyond those given by up to 0.1 % of a jump where D
 *     dt/h^2 is at most 5, D = k/(rho c), above that by up to 5 % (rho_inf = 1: 11 %) after a first
 *     step;
 *     particles in the first two cells at an isothermal wall off by up to 1 % of a jump from h^2/D
 *     after it on, 0.2 % from 5 h^2/D on;
 *     with sharp_gradients elastic waves and sound within 0.1 % at 32 cells a wave, order in space
 *     2.5; the pressure of a column at rest is off by up to 0.045 rho g h in the cells at its
 *     surface, 0.035 above its floor, and 0.02 between (else 0.02, 0.015 and 0.005);
 *     free flight exact to rounding where rho_sp = 0, else to O(dt^2); momentum to rounding away
 *     from walls and spray; a column at rest has a speed below 1e-4 sqrt(g h).
 *
 * STABILITY. gs4_stable_dt is the least of
 *     sound and viscosity   (om dt)^2 + d dt (3 + rho_inf + rho_sp - rho_inf rho_sp)/2
 *                                                              <= 2 (1 - rho_inf rho_sp),
 *                           om = 1.73 c/h, d = 2.5 F_v mu/(rho h^2);
 *                           c^2: of sound and of elastic waves, 2 c_max G0/rho of liquids,
 *                           G b_max/rho0 of solids (b_max of B; fixed-corotated
 *                           b_max (2 - 1/sqrt(b_max)));
 *                           sharp_gradients: om^2 and d 2.3 times as large;
 *                           symplectic Euler: (om dt)^2 + 2 d dt <= 4, om = 3.5 c/h,
 *                           d = 16 F_v mu/(rho h^2);
 *                           GS4: om^2 of a material is 4/(1 + 3 x) times as large where that is
 *                           more than 1, x = mass of a cell of the lightest material over that of
 *                           the heaviest particle: one among lighter ones swings by itself
 *                           partitioned: nu dt <= 0.4 h^2 (backward Euler 0.2), c dt <= h/2, c
 *                           of elastic waves alone; of surfaces dt <= (1/2 - rho_sp/4) sqrt(h/g)
 *     flow                  one cell a step along each axis, the fall within the step included,
 *                           and the rim of a collider that turns, where the domain can meet it
 *     strain, relaxation    |grad v| dt <= 1, of colliders too (sqrt(2) |w|),  dt <= 1000 lambda_b
 * and gs4_step refuses more. gs4_advance takes the fraction `cfl` of it, and half of that again, up
 * to 7 times, where a step is refused.
 *
 * IN A GAME. Sixty times a second, in 10 ms of computing each; desc.now is a clock. What does not
 * fit waits for the next frame, up to a tenth of a second: from there on the scene is slower than
 * the clock.
 *
 *     gs4_budget budget = { 0, 0.010, NULL, NULL };
 *     double due = 0, done;
 *     while (is_running()) {
 *         due = due + 1.0 / 60 < 0.1 ? due + 1.0 / 60 : 0.1;
 *         if (gs4_advance_within(sim, (gs4_real)due, &budget, &done) < 0) break;
 *         due -= done;
 *         draw(gs4_particles(sim, GS4_FIELD_POSITION));
 *     }
 *
 * ELLIPTIC SOLVER. gs4_poisson_* solves (diagonal - div coefficient grad) x = rhs on a box of cells
 * that are liquid, air or solid, by itself: multigrid in float preconditions conjugate gradients in
 * double. It needs 6 to 11 iterations for a residual of 1e-8 whatever the size, also where large
 * parts differ by 1000. Small parts that differ so, walls with holes of one cell, spray, porous
 * matter and serpentines take up to 21; single faces that differ by 1000 up to 130; a maze of
 * corridors one cell wide 80 (tests/test_poisson.c, bench/poisson.c). Pockets are found: there the
 * mean of x is 0, and the mean of rhs is taken off. At 256^3 it takes 45 bytes a cell where one
 * coefficient serves all faces, 58 else, 72 in double, 5 to 9 more with a diagonal; more in small
 * boxes (64^3: 63). A solve allocates nothing. `threads` and the same bits as below.
 *
 * OPTIONS (macros)             meaning                                             define it
 *     GS4MPM_IMPLEMENTATION    compile the implementation here                     in one file
 *     GS4_DOUBLE               gs4_real is double; functions end in _f64           everywhere
 *     GS4_STATIC               all functions static                                with the impl.
 *     GS4_PTHREADS             compile the thread pool (link with -lpthread)       with the impl.
 *     GS4_NO_VECTORS           arrays instead of vectors; the same bits, slower    with the impl.
 *
 * ERRORS. Every call returns 0 or more for success and a negative gs4_result otherwise;
 * gs4_last_error has a sentence. Every field is checked, NaN included. A call that fails has
 * changed nothing but the order of particles, out of memory included (sums follow that order: later
 * steps may differ in their last bits); a step that is refused has not been taken, though
 * gs4_advance keeps those before it. Callbacks, go_on of a budget too, must not change the
 * simulation that calls them: such calls are refused. What is allowed but hardly meant is said
 * through `log`, once.
 *
 * MEMORY. GS4: 65 bytes a particle in float (position, velocity, J and their rates, mass, id,
 * material, and 4 for sorting), 16 more unless flip_decay_time is INFINITY, 49 a cell near material
 * (sharp_gradients: 69), 16 more near walls and colliders, 4 per 64 cells of the domain; 40
 * (double: 72) more for each particle within 8 cells of a sticky collider, 264 (double: 516) for
 * each with an image, within three cells, and 20 (double: 40) a cell where such a collider is not
 * flat. Symplectic Euler: 89 and 33. A scene with a viscoelastic liquid: 48 more a particle (Euler
 * 24). With a solid: 96 more (Euler 36). With heat: 17 more a particle, 32 more with a
 * flux_relaxation_time, 16 (or 32) a cell near material, and about 100 a cell of the box around all
 * material, where the solver works; 150 where an axis is periodic.
 * Partitioned: 161 a particle, and about 320 a cell of the box around all material (double 313 and
 * 530), blocks and solver included; measured where it fills 64^3 cells. With viscosity or
 * elasticity about 120 more for each face within three cells of a free surface.
 * With a periodic axis 65 (double 73) more a cell, copies behind its walls included, and three to
 * six times as many iterations, more in larger boxes.
 * A mesh: about 400 (double 800) per cell face of its surface in the domain or within 10 cells of
 * it; where that is more than 1 GB it is refused. Its distance is sampled twice a cell within three
 * cells of the surface. A mesh that moves is sampled anew now and then, but for one that takes less
 * than 32 MB as a whole. While it is sampled, up to 130 more a triangle.
 * Double, GS4: 121 (32 more) and 97. Stepping allocates nothing once the scene has stopped growing;
 * a kernel takes 61 KB of stack, partitioned 71; in double 120 and 141.
 *
 * THREADS. `parallel_for` or the pool. The same bits for any number of threads: blocks of one
 * colour share no node, sums run in the order of particles within a block. Two simulations on two
 * threads are fine. Callbacks (distances, viscosity) may be called from several threads at once.
 *
 * DETERMINISM. Same binary, same input, same bits. No fused multiply-add is used, decided in this
 * file and undone at its end, so that -O0, -O2 and -O3 -march=native of one compiler agree too. Not
 * with -ffast-math, clang's -ffp-contract=fast, nor where doubles are kept in x87 registers.
 *
 * LIMITS. 1073741808 particles, 3992^3 cells, 256 materials. Time steps follow sound: viscosities
 * above some 100 Pa s at millimetre cells mean steps of microseconds. One velocity is at a node:
 * solids that touch stick together until they are two cells apart. Filling is refused where
 * material is already; emitters pause when max_particles is reached. An emitter gives what its
 * velocity says whatever is before it. Where that goes slower, as in a sticky pipe as wide as the
 * emitter, particles pack 1.4 to 1.8 times too densely within a radius or two of it, and J does not
 * tell.
 *
 * SOURCES. The GS4 family: Zhou & Tamma 2004. Extended Pom-Pom: Verbeeten, Peters & Baaijens 2001,
 * in the form of Oishi et al. 2012. Regularised yield stress: after Bercovier & Engelman 1980. The
 * MPM scheme: after "GS4 viscoelastic MPM" (2021), with rates on particles. MLS-MPM: Hu et al.
 * 2018. Solids and their yield: "Augmented MPM" (Stomakhin et al. 2014). Mirror nodes, image
 * particles, contact and limits: measured for this file. */
#ifndef GS4MPM_H
#define GS4MPM_H

/* ==== [[config]] version, precision, linkage ================================================== */

#define GS4_VERSION 100 /* major * 10000 + minor * 100 + patch */
#define GS4_VERSION_STRING "0.1.0"

#include <stddef.h>
#include <stdint.h>

#ifdef GS4_DOUBLE /* defined before every include of the header, or never */
typedef double gs4_real;
#define gs4_add_collider gs4_add_collider_f64
#define gs4_add_emitter gs4_add_emitter_f64
#define gs4_add_material gs4_add_material_f64
#define gs4_add_particles gs4_add_particles_f64
#define gs4_add_points gs4_add_points_f64
#define gs4_advance gs4_advance_f64
#define gs4_advance_within gs4_advance_within_f64
#define gs4_box gs4_box_f64
#define gs4_collider_pose gs4_collider_pose_f64
#define gs4_create gs4_create_f64
#define gs4_cylinder gs4_cylinder_f64
#define gs4_destroy gs4_destroy_f64
#define gs4_edit_particles gs4_edit_particles_f64
#define gs4_emitter_pose gs4_emitter_pose_f64
#define gs4_get_desc gs4_get_desc_f64
#define gs4_get_stats gs4_get_stats_f64
#define gs4_last_error gs4_last_error_f64
#define gs4_load gs4_load_f64
#define gs4_material_preset gs4_material_preset_f64
#define gs4_mesh gs4_mesh_f64
#define gs4_move_collider gs4_move_collider_f64
#define gs4_move_collider_to gs4_move_collider_to_f64
#define gs4_move_emitter gs4_move_emitter_f64
#define gs4_move_emitter_to gs4_move_emitter_to_f64
#define gs4_particle_ids gs4_particle_ids_f64
#define gs4_particle_materials gs4_particle_materials_f64
#define gs4_particles gs4_particles_f64
#define gs4_plane gs4_plane_f64
#define gs4_point_step gs4_point_step_f64
#define gs4_point_stress gs4_point_stress_f64
#define gs4_poisson_create gs4_poisson_create_f64
#define gs4_poisson_destroy gs4_poisson_destroy_f64
#define gs4_poisson_solve gs4_poisson_solve_f64
#define gs4_put_collider gs4_put_collider_f64
#define gs4_put_emitter gs4_put_emitter_f64
#define gs4_real_size gs4_real_size_f64
#define gs4_remove_particles gs4_remove_particles_f64
#define gs4_result_string gs4_result_string_f64
#define gs4_save gs4_save_f64
#define gs4_sdf gs4_sdf_f64
#define gs4_set_gravity gs4_set_gravity_f64
#define gs4_set_viscosity gs4_set_viscosity_f64
#define gs4_sphere gs4_sphere_f64
#define gs4_stable_dt gs4_stable_dt_f64
#define gs4_state_hash gs4_state_hash_f64
#define gs4_step gs4_step_f64
#define gs4_version gs4_version_f64
#define gs4_write_ply gs4_write_ply_f64
#define gs4_write_raw gs4_write_raw_f64
#else
typedef float gs4_real;
#endif

#ifdef GS4_STATIC
#if defined(__GNUC__)
#define GS4_API static __attribute__((unused))
#else
#define GS4_API static
#endif
#else
#define GS4_API extern
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ==== [[types]] results, vectors, shapes, hooks, views ======================================== */

typedef struct gs4_vec3 {
    gs4_real x, y, z;
} gs4_vec3;

/* 0 is success and every error is negative, so that a call that returns an id or a count needs no
 * second channel. gs4_last_error has a sentence for each error. */
typedef enum gs4_result {
    GS4_OK = 0,
    GS4_ERROR_ARGUMENT = -1, /* a value is out of its range; the sentence names it and the range */
    GS4_ERROR_MEMORY = -2,
    GS4_ERROR_IO = -3,     /* a file could not be opened, written whole or read */
    GS4_ERROR_FORMAT = -4, /* a file is not what it says it is, or is damaged */
    /* dt is above the stability limit, or the state would become non-finite or leave the physical
     * range: the step was not taken, the state is that of the last good step */
    GS4_ERROR_UNSTABLE = -5,
    GS4_ERROR_NOT_CONVERGED = -6, /* a linear solve did not reach its tolerance; likewise */
    GS4_ERROR_ABI = -7 /* header and implementation were compiled with different settings */
} gs4_result;

GS4_API const char *gs4_result_string(int result);
GS4_API int gs4_version(void);   /* GS4_VERSION of the implementation */
GS4_API int gs4_real_size(void); /* bytes of gs4_real in the implementation */

/* Signed distance (m, negative inside) of a point, finite; from several threads at once when there
 * are. A step or a filling that sees one that is not finite is refused. It must not change: of a
 * sticky body at rest it is asked for when blocks of material come and go, not every step. */
typedef gs4_real (*gs4_sdf_fn)(gs4_vec3 point, void *user);

typedef enum gs4_shape_kind {
    GS4_SHAPE_NONE = 0,
    GS4_SHAPE_BOX,
    GS4_SHAPE_SPHERE,
    GS4_SHAPE_CYLINDER,
    GS4_SHAPE_PLANE,
    GS4_SHAPE_SDF,
    GS4_SHAPE_MESH
} gs4_shape_kind;

/* A shape is its signed distance: for filling, colliders and emitters alike. It is a plain value,
 * which is copied; build it with the functions below, its fields are the implementation's. */
typedef struct gs4_shape {
    gs4_shape_kind kind;
    gs4_vec3 a, b; /* corners, ends, or point and outward normal */
    gs4_real radius;
    gs4_sdf_fn distance;
    void *user;
    const gs4_real *vertices;
    const int *triangles;
    int vertex_count, triangle_count;
} gs4_shape;

GS4_API gs4_shape gs4_box(gs4_vec3 low, gs4_vec3 high);
GS4_API gs4_shape gs4_sphere(gs4_vec3 centre, gs4_real radius);

/* From a to b, with flat ends. */
GS4_API gs4_shape gs4_cylinder(gs4_vec3 a, gs4_vec3 b, gs4_real radius);

/* All that is behind the plane. */
GS4_API gs4_shape gs4_plane(gs4_vec3 point, gs4_vec3 outward_normal);

/* low and high bound where the distance is negative. */
GS4_API gs4_shape gs4_sdf(gs4_sdf_fn distance, void *user, gs4_vec3 low, gs4_vec3 high);

/* A closed surface: 3 coordinates a vertex; 3 vertices a triangle, counter-clockwise from outside.
 * Vertices at one place are one; those of no triangle do not count. Parts that overlap are a union,
 * a part that faces inwards within another is a hollow. What is not closed or inside out is
 * refused. Both arrays must outlive the simulation and stay as they are. */
GS4_API gs4_shape gs4_mesh(const gs4_real *vertices_xyz, int vertex_count, const int *triangles,
                           int triangle_count);

/* Both functions or neither. */
typedef struct gs4_allocator {
    void *(*alloc_fn)(size_t bytes, size_t alignment, void *user);
    void (*free_fn)(void *memory, size_t bytes, void *user);
    void *user;
} gs4_allocator;

/* Runs task(0, context) to task(count - 1, context), in any order; returns when all are done. */
typedef void (*gs4_task_fn)(int index, void *context);
typedef void (*gs4_parallel_for_fn)(int count, gs4_task_fn task, void *context, void *user);

/* Level 0: information, 1: warning, 2: error. */
typedef void (*gs4_log_fn)(int level, const char *message, void *user);

/* A clock in seconds; without one all timings are 0. Times that it says are negative or no number
 * count as 0. */
typedef double (*gs4_now_fn)(void *user);

/* ==== [[materials]] what matter is ============================================================ */

/* What stress a liquid has beside 2 mu D; UCM is Oldroyd-B with local_fraction 0. */
typedef enum gs4_liquid {
    GS4_NEWTONIAN = 0,
    GS4_OLDROYD_B,
    GS4_POM_POM
} gs4_liquid;

typedef enum gs4_solid {
    GS4_NO_SOLID = 0,
    GS4_NEO_HOOKEAN,
    GS4_FIXED_COROTATED
} gs4_solid;

typedef enum gs4_viscosity_law {
    GS4_VISCOSITY_CONSTANT = 0,
    GS4_VISCOSITY_CROSS_WLF,
    GS4_VISCOSITY_CALLBACK,
    GS4_VISCOSITY_HERSCHEL_BULKLEY
} gs4_viscosity_law;

/* Pa s, of a temperature and a shear rate (1/s), and of nothing else: 0 or a finite number above.
 * From several threads at once when there are. */
typedef gs4_real (*gs4_viscosity_fn)(gs4_real temperature, gs4_real shear_rate, void *user);

/* All zero but `density`: an inviscid liquid. The equations are in MODEL at the top; what a field
 * is for and the material has not must be 0. */
typedef struct gs4_material {
    gs4_real density; /* rho0, kg/m^3, above 0 */

    /* Liquid phase, (2) and (5). Viscoelastic: G0 = (1 - local_fraction) viscosity /
     * relaxation_time, Pa. */
    gs4_liquid liquid;
    gs4_real viscosity;       /* mu in all, Pa s, 0 or above */
    gs4_real local_fraction;  /* F_v, 0 to 1; of GS4_NEWTONIAN 1, whatever is here */
    gs4_real relaxation_time; /* lambda_b, s, above 0 where it is viscoelastic */
    gs4_real stretch_time;    /* lambda_0s, s, above 0; GS4_POM_POM, as the next two */
    gs4_real anisotropy;      /* alpha, 0 to 1e6 */
    gs4_real arms;            /* Q, 1 or above */

    /* Cross-WLF: mu = mu0 / (1 + a (mu0 rate)^n), mu0 = d1 exp(-a1 (T - t1) / (T - t2)). All zero:
     * the constants of "GS4 viscoelastic MPM" (SOURCES), for degrees Celsius. */
    gs4_viscosity_law viscosity_law;
    struct {
        gs4_real a, n, d1, a1, t1, t2;
    } cross_wlf;
    gs4_viscosity_fn viscosity_fn; /* of GS4_VISCOSITY_CALLBACK */
    void *viscosity_user;

    /* Herschel-Bulkley, Newtonian otherwise and with `viscosity` 0: it stands still under less than
     * its yield stress. mu = yield_stress / e + consistency e^(index - 1), e^2 = rate^2 +
     * creep_rate^2. What creep_rate costs is in MODEL at (8). */
    struct {
        gs4_real yield_stress; /* Pa */
        gs4_real consistency;  /* Pa s^index */
        gs4_real index;        /* 0.1 to 2; 1: Bingham */
        gs4_real creep_rate;   /* 1/s, above 0 with a yield stress or an index below 1 */
    } herschel_bulkley;

    /* Volume response of both phases, (3): give one of the two, or neither. Then rho0 c0^2 = 100
     * rho_max (2 g H + v^2), H the height of the domain, v the greatest speed given so far, of the
     * rims of colliders too, rho_max the density of the densest material: flow compresses by 1 %,
     * impact by more; of solids at least 10 G. One that is given for the lighter of two materials
     * should bear the weight of the denser one, too. */
    gs4_real bulk_modulus; /* K = rho0 c0^2, Pa */
    gs4_real sound_speed;  /* c0, m/s */
    int incompressible;    /* with GS4_PARTITIONED: non-zero: K is infinite */

    /* Solid phase, (6): below melting_temperature, or always where it never melts. Then `liquid`
     * is GS4_NEWTONIAN and `viscosity` damps the solid. */
    gs4_solid solid;
    gs4_real shear_modulus;     /* G, Pa, above 0 for a solid */
    gs4_real yield_compression; /* theta_c, below 1; 0: elastic */
    gs4_real yield_stretch;     /* theta_s; 0: elastic */

    /* Heat, (7). A scene where no material conducts, melts or is heated by viscosity carries no
     * temperature at all; in one that does every material needs a heat_capacity. */
    gs4_real heat_capacity;        /* c, J/(kg K) */
    gs4_real conductivity;         /* k, W/(m K) */
    gs4_real flux_relaxation_time; /* t of (7), s; 0: Fourier */
    gs4_real fourier_fraction;     /* F_T, 0 to 1; 0 with a relaxation time: Cattaneo */
    gs4_real melting_temperature;  /* T_m */
    gs4_real latent_heat;          /* L, J/kg; 0: it melts at T_m at once */
    int can_melt;        /* non-zero: phase follows temperature; zero: it is fixed by `solid` */
    int viscous_heating; /* non-zero: the work of its stress, without the pressure, heats it */
} gs4_material;

/* ==== [[sim]] description, scene, stepping, views, files ====================================== */

/* This version has GS4_EXPLICIT and GS4_PARTITIONED; the other is refused. */
typedef enum gs4_scheme {
    GS4_EXPLICIT = 0,
    GS4_PARTITIONED,
    GS4_SEMI_IMPLICIT
} gs4_scheme;

/* Second order in time; first order, of GS4_PARTITIONED; first order with one transfer each way,
 * the fast tier of GS4_EXPLICIT. */
typedef enum gs4_integrator {
    GS4_INTEGRATOR_GS4 = 0,
    GS4_INTEGRATOR_BACKWARD_EULER,
    GS4_INTEGRATOR_SYMPLECTIC_EULER
} gs4_integrator;

/* What a wall does to material, see CONTACT. Particles that leave through an open one are dropped;
 * both walls of an axis are periodic, or neither. */
typedef enum gs4_wall {
    GS4_WALL_STICK = 0,
    GS4_WALL_SLIP,
    GS4_WALL_SEPARATE,
    GS4_WALL_OPEN,
    GS4_WALL_PERIODIC
} gs4_wall;

typedef struct gs4_sim gs4_sim;

/* All zero but `cells` and `cell_size`: a closed box of sticky walls without gravity. */
typedef struct gs4_sim_desc {
    int cells[3];       /* of each axis, 4 or more */
    gs4_real cell_size; /* h, m, 1e-9 to 1e9 */
    gs4_vec3 origin;    /* low corner of the grid, m */
    gs4_vec3 gravity;   /* m/s^2 */
    gs4_scheme scheme;
    gs4_integrator integrator;
    /* The member of the GS4 family, see TIME: 0 <= rho_inf_spurious <= rho_inf <= 1. Their product
     * is at most 0.98, or no explicit step is stable. */
    gs4_real rho_inf, rho_inf_spurious;
    /* s, in which motion of particles that the grid cannot see decays; INFINITY: never, FLIP. 0: as
     * fast as it crosses cells itself and in 0.5 s else, and the same of J, see NOISE. Symplectic
     * Euler has an affine velocity (APIC) in its place. */
    gs4_real flip_decay_time;

    /* Walls -x +x -y +y -z +z, and the air. What is not isothermal is insulated. */
    gs4_wall walls[6];
    gs4_real wall_temperature[6];
    int wall_is_isothermal[6];
    gs4_real ambient_temperature; /* of the air */
    int air_is_isothermal;

    gs4_real cfl;              /* fraction of the stable dt that gs4_advance takes; 0: 0.5 */
    gs4_real max_dt;           /* s, for gs4_advance; 0: none */
    gs4_real solver_tolerance; /* relative residual of solves; 0: 1e-6 in double, 1e-4 in float */
    int solver_max_iterations; /* 0: 200 */
    int max_particles;         /* 0: grows as needed */

    /* More threads than 0 or 1 need GS4_PTHREADS or parallel_for; the results do not depend on
     * them. Without an allocator calloc and free are used; without log and now it is silent. */
    int threads;
    gs4_parallel_for_fn parallel_for;
    void *parallel_user;
    gs4_allocator allocator;
    gs4_log_fn log;
    void *log_user;
    gs4_now_fn now;
    void *now_user;

    /* 1: the error of second order of the transfers is taken out of gradients and forces, of
     * liquids alone and not with symplectic Euler. Waves of elasticity and sound are within 0.1 %
     * at 32 cells a wave instead of 1.1 %; the error of a drop that breathes halves. A step takes
     * 1.2 times as long, and there are 1.5 (sound) to 2.3 (viscosity) times as many. */
    int sharp_gradients;
} gs4_sim_desc;

GS4_API int gs4_create(const gs4_sim_desc *desc, gs4_sim **sim);
GS4_API void gs4_destroy(gs4_sim *sim); /* NULL is fine */

/* Why the last call that failed did: which field, its value, what would be accepted. NULL: of the
 * last call without a simulation on this thread. */
GS4_API const char *gs4_last_error(const gs4_sim *sim);

/* With every default filled in. */
GS4_API gs4_sim_desc gs4_get_desc(const gs4_sim *sim);

/* Of the whole state: equal for any number of threads, and after loading. */
GS4_API uint64_t gs4_state_hash(const gs4_sim *sim);

/* The id of the new material, from 0; up to 256. */
GS4_API int gs4_add_material(gs4_sim *sim, const gs4_material *material);

/* Change the world between steps: gravity (m/s^2), as in a tank that is tilted; the member
 * `viscosity` of a material (Pa s). A checkpoint is loaded where both are as they were. */
GS4_API int gs4_set_gravity(gs4_sim *sim, gs4_vec3 gravity);
GS4_API int gs4_set_viscosity(gs4_sim *sim, int material, gs4_real viscosity);

/* Liquids: water, olive oil, glycerol, honey. Viscoelastic: cream (shaving foam, not the food), ice
 * cream, boger fluid, polymer melt. With a yield stress, and a creep_rate of 0.1 1/s: ketchup,
 * yoghurt, mayonnaise, toothpaste, mud, paint, blood. Melting, in degrees Celsius, with solids
 * much softer than real ones: chocolate, wax, butter, lava. Sources are in [[liquid]]. */
GS4_API int gs4_material_preset(const char *name, gs4_material *material);

typedef struct gs4_fill {
    int material;     /* id */
    gs4_real spacing; /* m between particles, up to a cell; 0: half a cell, 8 particles a cell */
    gs4_vec3 velocity;
    gs4_vec3 angular_velocity; /* rad/s, about the centre of the shape */
    gs4_real temperature;      /* in scenes with heat */
    gs4_real jitter;           /* 0 to 1, of the spacing */
    uint32_t random_seed;
} gs4_fill;

/* Particles in a shape, or at points that fill `volume_each` (m^3). How many there are now more. */
GS4_API int gs4_add_particles(gs4_sim *sim, gs4_shape shape, const gs4_fill *fill);
GS4_API int gs4_add_points(gs4_sim *sim, const gs4_real *xyz, int count, gs4_real volume_each,
                           const gs4_fill *fill);

/* Take those in a shape away. How many there were; others keep their ids. */
GS4_API int gs4_remove_particles(gs4_sim *sim, gs4_shape shape);

/* A rigid body that moves as it is told, whatever the material does. */
typedef struct gs4_collider {
    gs4_shape shape;
    gs4_wall contact;                    /* stick, slip or separate */
    gs4_real friction;                   /* Coulomb's coefficient, for separate */
    gs4_vec3 velocity, angular_velocity; /* m/s of the pivot; rad/s about it */
    gs4_vec3 pivot;                      /* where it is at first, m */
    gs4_real temperature;
    int is_isothermal; /* 0: insulated */
} gs4_collider;

/* The id of the new collider; later changes of its velocities. */
GS4_API int gs4_add_collider(gs4_sim *sim, const gs4_collider *collider);
GS4_API int gs4_move_collider(gs4_sim *sim, int collider, gs4_vec3 velocity,
                              gs4_vec3 angular_velocity);

/* A source of material: its shape is full at `start`, and is filled again as material
 * flows out of it with fill.velocity, relative to it. It gives |fill.velocity| times the area that
 * its shape has across the flow, whatever it travels. What is in it travels with it. */
typedef struct gs4_emitter {
    gs4_shape shape;
    gs4_fill fill;        /* the spacing becomes what fits the shape evenly */
    gs4_vec3 travel;      /* velocity of the emitter itself from `start` on, m/s */
    gs4_real start, stop; /* s; stop 0: never */
    gs4_vec3 pivot;       /* of its pose, m; where it is at first */
} gs4_emitter;

/* The id of the new emitter; later changes of its velocity, without a turn. */
GS4_API int gs4_add_emitter(gs4_sim *sim, const gs4_emitter *emitter);
GS4_API int gs4_move_emitter(gs4_sim *sim, int emitter, gs4_vec3 travel);

/* Where a collider or an emitter is: point p of its shape, as described, is at
 * position + R (p - pivot), R the turn that the quaternion is for. An emitter's flow turns too. */
typedef struct gs4_pose {
    gs4_vec3 position;      /* of the pivot, m */
    gs4_real quaternion[4]; /* w x y z, of any length; all 0 is none: 1 0 0 0 */
} gs4_pose;

/* Where it is now. Put it there at once: its velocities stay. Move it so that it is there after
 * `duration` (s), at constant velocities, the short way round; they stay until changed. */
GS4_API int gs4_collider_pose(gs4_sim *sim, int collider, gs4_pose *pose);
GS4_API int gs4_emitter_pose(gs4_sim *sim, int emitter, gs4_pose *pose);
GS4_API int gs4_put_collider(gs4_sim *sim, int collider, const gs4_pose *pose);
GS4_API int gs4_put_emitter(gs4_sim *sim, int emitter, const gs4_pose *pose);
GS4_API int gs4_move_collider_to(gs4_sim *sim, int collider, const gs4_pose *pose,
                                 gs4_real duration);
GS4_API int gs4_move_emitter_to(gs4_sim *sim, int emitter, const gs4_pose *pose, gs4_real duration);

/* One step of exactly dt (s), at most gs4_stable_dt; or as many as it takes to end after exactly
 * `duration` (s). A step that is refused has not been done. The steps that gs4_advance took before
 * it have: the sentence says how many, and how much time is left (gs4_stats.time_left). */
GS4_API int gs4_step(gs4_sim *sim, gs4_real dt);
GS4_API int gs4_advance(gs4_sim *sim, gs4_real duration);

/* What gs4_advance_within may use. It ends after a step that uses it up, and before one that as
 * long as the last one would exceed `seconds`; it takes one step at least. All 0: no limit. */
typedef struct gs4_budget {
    int steps;
    double seconds;           /* by `now` of the description */
    int (*go_on)(void *user); /* asked after each step; 0: stop */
    void *user;
} gs4_budget;

/* gs4_advance within a budget. `done` (s), if it is not NULL, is how much of the duration has
 * passed, refused or not; the rest is gs4_stats.time_left. To end early is no error. */
GS4_API int gs4_advance_within(gs4_sim *sim, gs4_real duration, const gs4_budget *budget,
                               double *done);

/* s, see STABILITY; without `cfl`. 0 where a viscosity is none, and in a viscosity callback that
 * this asked: gs4_last_error says which. */
GS4_API gs4_real gs4_stable_dt(const gs4_sim *sim);

/* Of each particle; SI. A scene has stress to flux only where a material needs them. */
typedef enum gs4_field {
    GS4_FIELD_POSITION = 0,
    GS4_FIELD_VELOCITY,
    GS4_FIELD_VOLUME_RATIO, /* J */
    GS4_FIELD_STRESS,       /* s, non-local: xx yy zz xy xz yz */
    GS4_FIELD_DEFORMATION,  /* F, row-major, det F = J; of liquids J^(1/3) I */
    GS4_FIELD_TEMPERATURE,
    GS4_FIELD_LIQUID_FRACTION, /* 0 to 1 */
    GS4_FIELD_FLUX,            /* q_NL, W/m^2 */
    GS4_FIELD_MASS,
    /* Pa, of the solve of GS4_PARTITIONED, at the stage of the last step; 0 before a first step and
     * where no liquid is near. In a pool at rest, particles laid evenly, it is within 0.05 % of rho
     * g times the depth. With GS4_EXPLICIT there is none: (3) says it of J. */
    GS4_FIELD_PRESSURE
} gs4_field;

/* No copies: element i begins at data + i stride. data is NULL where there is no such field. Both
 * are valid until the next call that changes the simulation. */
typedef struct gs4_view {
    const gs4_real *data;
    int count, components, stride;
} gs4_view;
typedef struct gs4_edit {
    gs4_real *data;
    int count, components, stride;
} gs4_edit;

GS4_API gs4_view gs4_particles(const gs4_sim *sim, gs4_field field);

/* Position, velocity and temperature. The next call checks what was written, and melts or freezes
 * what temperatures say; the next step starts the integrator anew. */
GS4_API gs4_edit gs4_edit_particles(gs4_sim *sim, gs4_field field);

/* Sorting changes the order of particles and not their ids. */
GS4_API const uint32_t *gs4_particle_ids(const gs4_sim *sim);
GS4_API const uint8_t *gs4_particle_materials(const gs4_sim *sim);

typedef struct gs4_stats {
    double time; /* s */
    uint64_t steps;
    double dt; /* s, of the last step */
    int particles, active_cells;
    uint64_t memory_bytes;
    /* sums over particles, SI; angular momentum about the origin of coordinates */
    double mass, momentum[3], angular_momentum[3], kinetic_energy, thermal_energy, volume;
    /* m^3 that material occupies by how densely particles lie, whatever J says: exact for blocks.
     * -1 where it is not known: in callbacks, after an edit out of the grid, out of memory. */
    double occupied_volume;
    double max_speed, min_volume_ratio, max_volume_ratio, min_temperature, max_temperature;
    /* of the last solves; the explicit scheme solves for heat alone */
    int pressure_iterations, viscous_iterations, heat_iterations, elastic_iterations;
    double solver_residual; /* finite, the largest; of a step that was refused, too */
    /* So far: particles whose stress needed substeps; whose stretch had to be bounded, of liquids
     * with anisotropy above 1 and of solids without yield beyond 512. */
    uint64_t stress_substeps;
    uint64_t stress_bounded;
    /* so far; stress is evaluated within the transfers */
    double seconds_transfer, seconds_stress, seconds_solve, seconds_sort, seconds_total;
    double time_left; /* s, of the duration of the last gs4_advance: 0 unless it ended early */
} gs4_stats;
GS4_API gs4_stats gs4_get_stats(gs4_sim *sim);

/* Frames: binary little-endian PLY with x y z, vx vy vz and the other fields that the scene has; or
 * NumPy's .npy, one record a particle: numpy.load(path)['velocity']. They and checkpoints are
 * written beside the target as gs4mpm-*.tmp and renamed, so that a reader never sees half a file
 * whatever else writes there; symbolic links stay. Only a program that is killed leaves a .tmp. */
GS4_API int gs4_write_ply(gs4_sim *sim, const char *path);
GS4_API int gs4_write_raw(gs4_sim *sim, const char *path);

/* Checkpoints: the whole state, into a simulation with the same description, materials, colliders
 * and emitters. It continues bit for bit. */
GS4_API int gs4_save(gs4_sim *sim, const char *path);
GS4_API int gs4_load(gs4_sim *sim, const char *path);

/* One material point, by the code that particles run: for rheometry and teaching. All zero: at
 * rest. A step starts anew where stress_rate is zero; set it to zero where the flow changes at
 * once. Errors have a sentence in gs4_last_error(NULL). */
typedef struct gs4_point {
    gs4_real stress[6], stress_rate[6]; /* non-local: xx yy zz xy xz yz, Pa and Pa/s */
    gs4_real deformation[9];            /* F of solids, elastic part, det F > 0; all zero: I */
    gs4_real temperature;               /* for viscosity laws */
} gs4_point;

/* A step of dt (s) in the flow L[3 i + j] = dv_i/dx_j (1/s). */
GS4_API int gs4_point_step(const gs4_material *material, gs4_point *point,
                           const gs4_real velocity_gradient[9], gs4_real dt, gs4_real rho_inf,
                           gs4_real rho_inf_spurious);

/* (2) without the pressure: 2 F_v mu D, non-local stress and stress of F; xx yy zz xy xz yz, Pa. */
GS4_API int gs4_point_stress(const gs4_material *material, const gs4_point *point,
                             const gs4_real velocity_gradient[9], gs4_real cauchy[6]);

/* ==== [[poisson]] the elliptic solver by itself =============================================== */

/* (diagonal - div coefficient grad) x = rhs in the liquid cells of a box of cubic cells. For each
 *     diagonal_i x_i + sum over its faces of coefficient_f (x_i - x_j) / cell_size^2 = rhs_i
 * where a neighbour in the air has x given at its centre; into solids and beyond the box nothing
 * flows. */
typedef enum gs4_cell {
    GS4_CELL_AIR = 0,    /* x is given */
    GS4_CELL_LIQUID = 1, /* x is unknown */
    GS4_CELL_SOLID = 2
} gs4_cell;

/* Arrays have x fastest, then y. gs4_poisson_create alone reads them. */
typedef struct gs4_poisson_desc {
    int cells[3];             /* of each axis, up to 2^21 */
    gs4_real cell_size;       /* 1e-9 to 1e9 */
    const uint8_t *kind;      /* gs4_cell, per cell */
    const gs4_real *diagonal; /* per cell, 0 or above; NULL: 0 */
    /* per face of each axis, of which there is one more than cells along that axis: face i is
     * before cell i; 0 or above; NULL: 1 */
    const gs4_real *coefficient[3];
    gs4_real tolerance; /* relative residual; 0: 1e-6 in double, 1e-4 in float */
    int max_iterations; /* 0: 200 */
    /* as in gs4_sim_desc */
    int threads;
    gs4_parallel_for_fn parallel_for;
    void *parallel_user;
    gs4_allocator allocator;
    gs4_now_fn now;
    void *now_user;
} gs4_poisson_desc;

typedef struct gs4_poisson gs4_poisson;

typedef struct gs4_solve_stats {
    int iterations;
    /* |b - A x| / |b| in the 2-norm, b with what flows in from the air; of x before it is rounded
     * to gs4_real */
    double residual;
    double setup_seconds, solve_seconds;
    uint64_t memory_bytes;
    /* Parts of the liquid with neither air nor diagonal: x has mean 0 there, and the mean of rhs,
     * which no x can meet, is taken off. The largest |mean|. */
    int pockets;
    double removed_mean;
} gs4_solve_stats;

/* Every value that matters must be finite. Those of solids, rhs in the air, and coefficients of
 * faces that nothing flows through may be anything. Errors have a sentence in
 * gs4_last_error(NULL). */
GS4_API int gs4_poisson_create(const gs4_poisson_desc *desc, gs4_poisson **solver);

/* x holds a guess and the values in the air, then the solution; stats may be NULL. After
 * GS4_ERROR_NOT_CONVERGED x is the iterate of the least residual, guess and 0 included, and
 * `residual` is true: that takes up to twice the time. After other errors x is as it was. */
GS4_API int gs4_poisson_solve(gs4_poisson *solver, const gs4_real *rhs, gs4_real *x,
                              gs4_solve_stats *stats);
GS4_API void gs4_poisson_destroy(gs4_poisson *solver); /* NULL is fine */

#ifdef __cplusplus
}
#endif
#endif /* GS4MPM_H */

/* #################################################################################################
 * ##  The implementation. Readers of the interface can stop here. ##
 * ############################################################################################## */
#if defined(GS4MPM_IMPLEMENTATION) && !defined(GS4I_IMPLEMENTED)
#define GS4I_IMPLEMENTED

/* ==== [[base]] arithmetic rules, memory, text, tasks ========================================== */

#include <stdlib.h>
#include <string.h>
#include <stdio.h>
#include <math.h>
#include <float.h>
#include <limits.h>
#include <assert.h>
#if defined(__unix__) || defined(__APPLE__)
#include <sys/types.h>
#include <sys/stat.h>
#include <unistd.h>
#endif
#ifdef GS4_PTHREADS
#include <pthread.h>
#endif

/* One product and one sum are rounded twice, always: fused operations would make results depend
 * on compiler flags. Undone at the end of the file, so that the code around keeps its own rule.
 * The vectorizer of gcc 12 fuses a * b - c beside d * e + f whatever the rule says (vfmaddsub,
 * fcmla). Without that of straight code nothing here is fused, which tests/portability.sh checks;
 * a step takes 0.15 % more instructions. gcc 12 also takes a function that fills a structure with
 * integers and reals for one that leaves it alone (induction variables without a base, then
 * ipa-modref); the callers then read what was there before. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__) && !defined(__TINYC__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off", "no-tree-slp-vectorize")
#if __GNUC__ >= 11
#pragma GCC optimize("no-ipa-modref")
#endif
#endif

#define GS4I_C(x) ((gs4_real)(x))
#ifdef GS4_DOUBLE
#define GS4I_SQRT sqrt
#define GS4I_TINY GS4I_C(1e-290)
#define GS4I_EPSILON GS4I_C(DBL_EPSILON)
#define GS4I_HUGE GS4I_C(1e100) /* beyond this an input is called absurd */
#else
#define GS4I_SQRT sqrtf
#define GS4I_TINY GS4I_C(1e-36)
#define GS4I_EPSILON GS4I_C(FLT_EPSILON)
#define GS4I_HUGE GS4I_C(1e18)
#endif

#if defined(__GNUC__) && !defined(__TINYC__)
#define GS4I_PREFETCH(p) __builtin_prefetch(p)
#else
#define GS4I_PREFETCH(p) ((void)(p))
#endif

#if defined(__GNUC__)
#define GS4I_RESTRICT __restrict__
#define GS4I_INLINE static inline __attribute__((always_inline))
#elif defined(_MSC_VER)
#define GS4I_RESTRICT __restrict
#define GS4I_INLINE static __forceinline
#else
#define GS4I_RESTRICT
#define GS4I_INLINE static inline
#endif

/* What runs once a call, far from steps: compilers make it small, which takes less time. */
#if defined(__GNUC__)
#define GS4I_COLD __attribute__((cold))
#else
#define GS4I_COLD
#endif

/* Every allocation of one simulation goes through here: 64-byte aligned, zeroed, counted. What
 * calloc zeroed is not touched again: large reservations take no memory before they are used. */
typedef struct gs4i_memory {
    gs4_allocator hook;
    uint64_t bytes;
    int in_hook; /* a hook is running */
} gs4i_memory;

static void *gs4i_default_alloc(size_t bytes, size_t alignment, void *user)
{
    char *raw, *aligned;
    (void)user;
    if (bytes > SIZE_MAX - alignment - sizeof(void *)) return NULL;
    raw = (char *)calloc(bytes + alignment + sizeof(void *), 1);
    if (!raw) return NULL;
    aligned = raw + sizeof(void *);
    aligned += (alignment - (size_t)((uintptr_t)aligned % alignment)) % alignment;
    memcpy(aligned - sizeof(void *), &raw, sizeof(void *));
    return aligned;
}

static void gs4i_default_free(void *memory, size_t bytes, void *user)
{
    char *raw;
    (void)bytes;
    (void)user;
    memcpy(&raw, (char *)memory - sizeof(void *), sizeof(void *));
    free(raw);
}

/* Scratch that is kept from step to step. */
typedef struct gs4i_scratch {
    void *data;
    size_t bytes;
} gs4i_scratch;

static void *gs4i_alloc(gs4i_memory *m, size_t count, size_t size)
{
    void *p;
    if (count == 0) count = 1;
    if (size && count > (SIZE_MAX / 2) / size) return NULL;
    m->in_hook = 1;
    p = m->hook.alloc_fn(count * size, 64, m->hook.user);
    m->in_hook = 0;
    if (!p) return NULL;
    if (m->hook.alloc_fn != gs4i_default_alloc) memset(p, 0, count * size);
    m->bytes += (uint64_t)count * size;
    return p;
}

static void gs4i_free(gs4i_memory *m, void *p, size_t count, size_t size)
{
    if (!p) return;
    if (count == 0) count = 1;
    m->bytes -= (uint64_t)count * size;
    m->in_hook = 1;
    m->hook.free_fn(p, count * size, m->hook.user);
    m->in_hook = 0;
}

/* At least `bytes` of scratch; what was in the first `keep` bytes stays. NULL when memory is
 * refused. */
static void *gs4i_scratch_reserve(gs4i_memory *m, gs4i_scratch *s, size_t bytes, size_t keep)
{
    void *grown;
    if (bytes <= s->bytes && s->data) return s->data;
    bytes += bytes / 4 + 64;
    grown = gs4i_alloc(m, bytes, 1);
    if (!grown) return NULL;
    if (keep) memcpy(grown, s->data, keep);
    gs4i_free(m, s->data, s->bytes, 1);
    s->data = grown;
    s->bytes = bytes;
    return grown;
}

/* An array of `count` elements with room for one more: itself, or a larger copy. NULL when memory
 * is refused. */
static void *gs4i_grow(gs4i_memory *m, void *data, int count, int *capacity, size_t size)
{
    const int wanted = *capacity ? 2 * *capacity : 4;
    void *grown;
    if (count < *capacity) return data;
    grown = gs4i_alloc(m, (size_t)wanted, size);
    if (!grown) return NULL;
    if (data) memcpy(grown, data, (size_t)count * size);
    gs4i_free(m, data, (size_t)*capacity, size);
    *capacity = wanted;
    return grown;
}

/* A sentence put together piece by piece: no printf, whose numbers depend on the locale. */
typedef struct gs4i_text {
    char *at;
    size_t left;
} gs4i_text;

static gs4i_text gs4i_text_into(char *buffer, size_t size)
{
    gs4i_text t;
    t.at = buffer;
    t.left = size;
    return t;
}

static void gs4i_put(gs4i_text *t, const char *s)
{
    while (*s && t->left > 1) {
        *t->at++ = *s++;
        t->left--;
    }
    if (t->left) *t->at = 0;
}

static void gs4i_put_integer(gs4i_text *t, int64_t value)
{
    char digits[24], *d = digits + sizeof digits - 1;
    uint64_t u = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    *d = 0;
    do {
        *--d = (char)('0' + (int)(u % 10));
        u /= 10;
    } while (u);
    if (value < 0) *--d = '-';
    gs4i_put(t, d);
}

/* Six significant digits of v > 0: v = d.ddddd x 10^exponent. */
static int gs4i_decimal_digits(double v, char digits[6])
{
    int exponent = 5, i;
    int64_t m;
    while (v >= 1e6) {
        v /= 10;
        exponent++;
    }
    while (v < 1e5) {
        v *= 10;
        exponent--;
    }
    m = (int64_t)(v + 0.5);
    if (m == 1000000) {
        m = 100000;
        exponent++;
    }
    for (i = 5; i >= 0; i--) {
        digits[i] = (char)('0' + (int)(m % 10));
        m /= 10;
    }
    return exponent;
}

/* Like %g in the C locale, with an exponent below 1e-4 and from 1e7 on. */
static void gs4i_put_real(gs4i_text *t, double v)
{
    char digits[6], out[32], *o = out;
    int exponent, is_scientific, point, i, n = 6;
    if (v < 0) gs4i_put(t, "-");
    v = v < 0 ? -v : v;
    if (!(v > 0 && v <= DBL_MAX)) {
        gs4i_put(t, v != v ? "NaN" : v > 0 ? "infinity" : "0");
        return;
    }
    exponent = gs4i_decimal_digits(v, digits);
    while (n > 1 && digits[n - 1] == '0') n--;
    is_scientific = exponent < -4 || exponent > 6;
    point = is_scientific ? 0 : exponent; /* the digit before the decimal point */
    if (point < 0) {
        *o++ = '0';
        *o++ = '.';
        for (i = -1; i > point; i--) *o++ = '0';
    }
    for (i = 0; i < n || i <= point; i++) {
        *o++ = i < n ? digits[i] : '0';
        if (i == point && i + 1 < n) *o++ = '.';
    }
    *o = 0;
    gs4i_put(t, out);
    if (!is_scientific) return;
    gs4i_put(t, "e");
    gs4i_put_integer(t, exponent);
}

/* Why a call failed: its code, a sentence, and who is told. Functions that can fail take one and
 * return the code, so that checks need no simulation. */
typedef struct gs4i_error {
    int code;
    char text[480];
    gs4_log_fn log;
    void *log_user;
    int quiet, in_log; /* errors are not for `log`; it is running */
} gs4i_error;

/* Tell `log`. Whatever it calls back is refused, and leaves no sentence. */
static void gs4i_log(gs4i_error *e, int level, const char *line)
{
    const gs4i_error before = *e;
    if (!e->log || e->in_log) return;
    e->in_log = 1;
    e->log(level, line == e->text ? before.text : line, e->log_user);
    *e = before;
}

/* A sentence begins, is put together, and ends with its code. */
static gs4i_text gs4i_begin_error(gs4i_error *e) { return gs4i_text_into(e->text, sizeof e->text); }

static int gs4i_end_error(gs4i_error *e, int code)
{
    e->code = code;
    if (!e->quiet) gs4i_log(e, 2, e->text);
    return code;
}

static int gs4i_fail(gs4i_error *e, int code, const char *what)
{
    gs4i_text t = gs4i_begin_error(e);
    gs4i_put(&t, what);
    return gs4i_end_error(e, code);
}

/* "<before><value><after>" */
static int gs4i_fail_value(gs4i_error *e, int code, const char *before, double value,
                           const char *after)
{
    gs4i_text t = gs4i_begin_error(e);
    gs4i_put(&t, before);
    gs4i_put_real(&t, value);
    gs4i_put(&t, after);
    return gs4i_end_error(e, code);
}

static int gs4i_fail_memory(gs4i_error *e)
{
    return gs4i_fail(e, GS4_ERROR_MEMORY, "out of memory; nothing has changed");
}

/* A rule that holds, or the sentence that says what would do. */
static int gs4i_require(gs4i_error *e, int holds, const char *otherwise)
{
    return holds ? GS4_OK : gs4i_fail(e, GS4_ERROR_ARGUMENT, otherwise);
}

/* The sentence is "<before><value><after>". */
static int gs4i_require_value(gs4i_error *e, int holds, const char *before, double value,
                              const char *after)
{
    return holds ? GS4_OK : gs4i_fail_value(e, GS4_ERROR_ARGUMENT, before, value, after);
}

#define GS4I_TRY(call)                       \
    do {                                     \
        int gs4i_r = (call);                 \
        if (gs4i_r != GS4_OK) return gs4i_r; \
    } while (0)

/* Finite, whatever flags the file is compiled with. */
GS4I_INLINE int gs4i_finite(gs4_real v)
{
#ifdef GS4_DOUBLE
    uint64_t u;
    memcpy(&u, &v, sizeof u);
    return (u & 0x7ff0000000000000u) != 0x7ff0000000000000u;
#else
    uint32_t u;
    memcpy(&u, &v, sizeof u);
    return (u & 0x7f800000u) != 0x7f800000u;
#endif
}

/* 0 or -0, also where the processor takes denormal numbers for 0. */
static int gs4i_is_zero(gs4_real v)
{
    const gs4_real zero = 0, minus_zero = -zero;
    return memcmp(&v, &zero, sizeof v) == 0 || memcmp(&v, &minus_zero, sizeof v) == 0;
}

/* Tasks: `count` calls of `task`, in any order, on any threads; nothing may depend on either. */
#ifdef GS4_PTHREADS
typedef struct gs4i_pool {
    pthread_mutex_t lock;
    pthread_cond_t wake, done;
    pthread_t *threads;
    int thread_count;
    gs4_task_fn task;
    void *context;
    int count, next, running, batch, quit;
    unsigned generation;
} gs4i_pool;
#endif

typedef struct gs4i_tasks {
    gs4_parallel_for_fn parallel_for;
    void *user;
#ifdef GS4_PTHREADS
    gs4i_pool *pool;
#endif
} gs4i_tasks;

#ifdef GS4_PTHREADS
/* Take batches of indices until none is left. Called and returns with the lock held. */
static void gs4i_pool_work(gs4i_pool *pool)
{
    while (pool->next < pool->count) {
        int i = pool->next, end = i + pool->batch;
        gs4_task_fn task = pool->task;
        void *context = pool->context;
        if (end > pool->count) end = pool->count;
        pool->next = end;
        pthread_mutex_unlock(&pool->lock);
        for (; i < end; i++) task(i, context);
        pthread_mutex_lock(&pool->lock);
    }
}

static void *gs4i_pool_main(void *argument)
{
    gs4i_pool *pool = (gs4i_pool *)argument;
    unsigned seen = 0;
    pthread_mutex_lock(&pool->lock);
    for (;;) {
        while (!pool->quit && pool->generation == seen) pthread_cond_wait(&pool->wake, &pool->lock);
        if (pool->quit) break;
        seen = pool->generation;
        pool->running++;
        gs4i_pool_work(pool);
        if (--pool->running == 0) pthread_cond_signal(&pool->done);
    }
    pthread_mutex_unlock(&pool->lock);
    return NULL;
}

static void gs4i_pool_run(gs4i_pool *pool, int count, gs4_task_fn task, void *context)
{
    pthread_mutex_lock(&pool->lock);
    pool->task = task;
    pool->context = context;
    pool->count = count;
    pool->next = 0;
    pool->batch = count / (8 * (pool->thread_count + 1));
    if (pool->batch < 1) pool->batch = 1;
    pool->generation++;
    pthread_cond_broadcast(&pool->wake);
    gs4i_pool_work(pool);
    while (pool->running) pthread_cond_wait(&pool->done, &pool->lock);
    pthread_mutex_unlock(&pool->lock);
}

static void gs4i_pool_destroy(gs4i_memory *memory, gs4i_pool *pool, int capacity)
{
    int i;
    if (!pool) return;
    pthread_mutex_lock(&pool->lock);
    pool->quit = 1;
    pthread_cond_broadcast(&pool->wake);
    pthread_mutex_unlock(&pool->lock);
    for (i = 0; i < pool->thread_count; i++) pthread_join(pool->threads[i], NULL);
    pthread_cond_destroy(&pool->wake);
    pthread_cond_destroy(&pool->done);
    pthread_mutex_destroy(&pool->lock);
    gs4i_free(memory, pool->threads, (size_t)capacity, sizeof(pthread_t));
    gs4i_free(memory, pool, 1, sizeof *pool);
}

/* `workers` threads beside the calling one; NULL when memory or threads are refused. */
static gs4i_pool *gs4i_pool_create(gs4i_memory *memory, int workers)
{
    gs4i_pool *pool = (gs4i_pool *)gs4i_alloc(memory, 1, sizeof *pool);
    if (!pool) return NULL;
    pool->threads = (pthread_t *)gs4i_alloc(memory, (size_t)workers, sizeof(pthread_t));
    if (!pool->threads) {
        gs4i_free(memory, pool, 1, sizeof *pool);
        return NULL;
    }
    pthread_mutex_init(&pool->lock, NULL);
    pthread_cond_init(&pool->wake, NULL);
    pthread_cond_init(&pool->done, NULL);
    for (; pool->thread_count < workers; pool->thread_count++)
        if (pthread_create(&pool->threads[pool->thread_count], NULL, gs4i_pool_main, pool) != 0) {
            gs4i_pool_destroy(memory, pool, workers);
            return NULL;
        }
    return pool;
}
#endif

static void gs4i_parallel_for(const gs4i_tasks *tasks, int count, gs4_task_fn task, void *context)
{
    int i;
    if (count > 1) {
        if (tasks->parallel_for) {
            tasks->parallel_for(count, task, context, tasks->user);
            return;
        }
#ifdef GS4_PTHREADS
        if (tasks->pool) {
            gs4i_pool_run(tasks->pool, count, task, context);
            return;
        }
#endif
    }
    for (i = 0; i < count; i++) task(i, context);
}

/* Ascending heap sort of block numbers: in place, no recursion, no libc qsort whose order of
 * equals varies. */
static void gs4i_sort(uint32_t *v, int n)
{
    int start = n / 2, end = n;
    while (end > 1) {
        int root, child;
        if (start > 0)
            start--;
        else {
            uint32_t t = v[--end];
            v[end] = v[0];
            v[0] = t;
        }
        for (root = start; (child = 2 * root + 1) < end; root = child) {
            uint32_t t;
            if (child + 1 < end && v[child] < v[child + 1]) child++;
            if (v[root] >= v[child]) break;
            t = v[root];
            v[root] = v[child];
            v[child] = t;
        }
    }
}

/* Seconds between two times that a clock said; 0 where they run backwards or are no numbers. */
static double gs4i_elapsed(double start, double end)
{
    const double seconds = end - start;
    return seconds > 0 && seconds < 1e300 ? seconds : 0;
}

/* splitmix64: hashes and jitter */
static uint64_t gs4i_mix(uint64_t z)
{
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static uint64_t gs4i_hash_bytes(uint64_t h, const void *data, size_t bytes)
{
    const unsigned char *p = (const unsigned char *)data;
    while (bytes >= 8) {
        uint64_t u;
        memcpy(&u, p, 8);
        h = gs4i_mix(h ^ u);
        p += 8;
        bytes -= 8;
    }
    if (bytes) {
        uint64_t u = 0;
        memcpy(&u, p, bytes);
        h = gs4i_mix(h ^ u ^ ((uint64_t)bytes << 56));
    }
    return h;
}

/* ==== [[vec]] three-vectors and shapes ======================================================== */

GS4I_INLINE gs4_vec3 gs4i_vec3(gs4_real x, gs4_real y, gs4_real z)
{
    gs4_vec3 v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}
GS4I_INLINE gs4_vec3 gs4i_add(gs4_vec3 a, gs4_vec3 b)
{
    return gs4i_vec3(a.x + b.x, a.y + b.y, a.z + b.z);
}
GS4I_INLINE gs4_vec3 gs4i_sub(gs4_vec3 a, gs4_vec3 b)
{
    return gs4i_vec3(a.x - b.x, a.y - b.y, a.z - b.z);
}
GS4I_INLINE gs4_vec3 gs4i_scale(gs4_vec3 a, gs4_real s)
{
    return gs4i_vec3(a.x * s, a.y * s, a.z * s);
}
GS4I_INLINE gs4_real gs4i_dot(gs4_vec3 a, gs4_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
GS4I_INLINE gs4_vec3 gs4i_cross(gs4_vec3 a, gs4_vec3 b)
{
    return gs4i_vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
GS4I_INLINE gs4_real gs4i_length(gs4_vec3 a) { return GS4I_SQRT(gs4i_dot(a, a)); }
GS4I_INLINE gs4_real gs4i_min(gs4_real a, gs4_real b) { return a < b ? a : b; }
GS4I_INLINE gs4_real gs4i_max(gs4_real a, gs4_real b) { return a > b ? a : b; }
/* fmin and fmax are calls; where many are asked, of numbers */
GS4I_INLINE double gs4i_lesser(double a, double b) { return a < b ? a : b; }
GS4I_INLINE double gs4i_greater(double a, double b) { return a > b ? a : b; }
GS4I_INLINE gs4_real gs4i_abs(gs4_real a) { return a < 0 ? -a : a; }
static void gs4i_to_double(gs4_vec3 a, double out[3])
{
    out[0] = (double)a.x;
    out[1] = (double)a.y;
    out[2] = (double)a.z;
}

/* Signed distances. Box: exact outside and inside. Cylinder: capped, exact. */
/* By its faces, so that one that is near is exact however far the others are. */
static gs4_real gs4i_box_distance(const gs4_shape *s, gs4_vec3 p)
{
    const gs4_vec3 q = gs4i_vec3(gs4i_max(s->a.x - p.x, p.x - s->b.x),
                                 gs4i_max(s->a.y - p.y, p.y - s->b.y),
                                 gs4i_max(s->a.z - p.z, p.z - s->b.z)),
                   out = gs4i_vec3(gs4i_max(q.x, 0), gs4i_max(q.y, 0), gs4i_max(q.z, 0));
    return gs4i_length(out) + gs4i_min(gs4i_max(q.x, gs4i_max(q.y, q.z)), 0);
}

static gs4_real gs4i_cylinder_distance(const gs4_shape *s, gs4_vec3 p)
{
    gs4_vec3 axis = gs4i_sub(s->b, s->a), r = gs4i_sub(p, s->a);
    gs4_real length = gs4i_length(axis), along = gs4i_dot(r, axis) / length;
    gs4_vec3 side = gs4i_sub(r, gs4i_scale(axis, along / length));
    gs4_real radial = gs4i_length(side) - s->radius, half = GS4I_C(0.5) * length;
    gs4_real cap = gs4i_abs(along - half) - half;
    gs4_real ro = gs4i_max(radial, 0), co = gs4i_max(cap, 0);
    return GS4I_SQRT(ro * ro + co * co) + gs4i_min(gs4i_max(radial, cap), 0);
}

/* Distance of every kind but a mesh, which needs its own structure ([[boundary]]). */
static gs4_real gs4i_shape_distance(const gs4_shape *s, gs4_vec3 p)
{
    switch (s->kind) {
    case GS4_SHAPE_BOX: return gs4i_box_distance(s, p);
    case GS4_SHAPE_SPHERE: return gs4i_length(gs4i_sub(p, s->a)) - s->radius;
    case GS4_SHAPE_CYLINDER: return gs4i_cylinder_distance(s, p);
    /* b is of unit length once checked */
    case GS4_SHAPE_PLANE: return gs4i_dot(gs4i_sub(p, s->a), s->b);
    case GS4_SHAPE_SDF: return s->distance(p, s->user);
    case GS4_SHAPE_NONE:
    case GS4_SHAPE_MESH: break;
    }
    return GS4I_HUGE;
}

/* Is the shape nothing but a half space for all points within `reach` of p that are not deeper
 * in it than `deep`? Then its outward unit normal. Planes, faces of boxes and ends of cylinders
 * are, where no edge is near and the far side is twice as deep. */
static int gs4i_shape_is_flat(const gs4_shape *s, gs4_vec3 p, gs4_real reach, gs4_real deep,
                              gs4_vec3 *normal)
{
    if (s->kind == GS4_SHAPE_BOX) {
        const gs4_real low[3] = { s->a.x - p.x, s->a.y - p.y, s->a.z - p.z },
                       high[3] = { p.x - s->b.x, p.y - s->b.y, p.z - s->b.z };
        gs4_real n[3] = { 0, 0, 0 };
        int a, face = 0;
        for (a = 1; a < 3; a++)
            if (gs4i_max(low[a], high[a]) > gs4i_max(low[face], high[face])) face = a;
        for (a = 0; a < 3; a++)
            if (a != face && gs4i_max(low[a], high[a]) > -(reach + deep)) return 0;
        n[face] = low[face] > high[face] ? GS4I_C(-1) : GS4I_C(1);
        *normal = gs4i_vec3(n[0], n[1], n[2]);
        return low[face] + high[face] < -2 * deep;
    }
    if (s->kind == GS4_SHAPE_CYLINDER) {
        const gs4_vec3 axis = gs4i_sub(s->b, s->a),
                       r = gs4i_sub(p, gs4i_scale(gs4i_add(s->a, s->b), GS4I_C(0.5)));
        const gs4_real length = gs4i_length(axis), along = gs4i_dot(r, axis) / length;
        *normal = gs4i_scale(axis, (along < 0 ? GS4I_C(-1) : GS4I_C(1)) / length);
        return gs4i_length(gs4i_sub(r, gs4i_scale(axis, along / length))) + reach + deep < s->radius
               && length > 2 * deep;
    }
    *normal = s->b;
    return s->kind == GS4_SHAPE_PLANE;
}

/* Box around a shape; a plane has none and takes the box given. */
static void gs4i_shape_bounds(const gs4_shape *s, gs4_vec3 *low, gs4_vec3 *high)
{
    switch (s->kind) {
    case GS4_SHAPE_BOX:
    case GS4_SHAPE_SDF:
    case GS4_SHAPE_MESH: /* once checked */
        *low = s->a;
        *high = s->b;
        break;
    case GS4_SHAPE_SPHERE:
        *low = gs4i_sub(s->a, gs4i_vec3(s->radius, s->radius, s->radius));
        *high = gs4i_add(s->a, gs4i_vec3(s->radius, s->radius, s->radius));
        break;
    case GS4_SHAPE_CYLINDER: {
        /* its ends are discs: r sin of the angle between their normal and each axis */
        const gs4_vec3 n = gs4i_sub(s->b, s->a);
        const gs4_real across = s->radius / gs4i_length(n);
        const gs4_vec3 r = gs4i_vec3(across * GS4I_SQRT(n.y * n.y + n.z * n.z),
                                     across * GS4I_SQRT(n.z * n.z + n.x * n.x),
                                     across * GS4I_SQRT(n.x * n.x + n.y * n.y));
        *low = gs4i_sub(
            gs4i_vec3(gs4i_min(s->a.x, s->b.x), gs4i_min(s->a.y, s->b.y), gs4i_min(s->a.z, s->b.z)),
            r);
        *high = gs4i_add(
            gs4i_vec3(gs4i_max(s->a.x, s->b.x), gs4i_max(s->a.y, s->b.y), gs4i_max(s->a.z, s->b.z)),
            r);
        break;
    }
    case GS4_SHAPE_NONE:
    case GS4_SHAPE_PLANE: break;
    }
}

/* ==== [[poisson]] multigrid and conjugate gradients on a masked grid =========================== *
 *
 * In each liquid cell i with faces f to cells j, and a_ii the sum of all that x_i is multiplied by:
 *     h^2 d_i x_i + sum over f of c_f (x_i - x_j) = h^2 b_i
 * x_j is given in the air; faces of solids and of the box have c_f = 0.
 *
 * OUTSIDE. Conjugate gradients in double; one symmetric V-cycle in float is the preconditioner
 * (gs4i_cycle: z from r). A p is formed in double from differences, and not stored.
 *
 * LEVELS. 0 is the grid; a cell of level 1 is a block of 2 x 2 x 2 of level 0. Beyond are graphs:
 * a node is a *connected group*, the strongly joined cells (or nodes) of a block of 2 x 2 x 2. So
 * a thin wall stays a wall. The last graph, of 200 nodes at most, is solved by Cholesky.
 *
 * TRANSFERS. Restriction sums, prolongation injects.
 *
 * COARSE MATRIX. Galerkin's with the faces halved: 1/2 the sum of the fine faces, 3/4 of those to
 * the air, 1 of the diagonal. Piecewise constants make differences twice too stiff: 1/2 mends it.
 * 3/4 was measured best. Graphs keep more of a face at a wall or a door (gs4i_series).
 *
 * SMOOTHER. Red-black Gauss-Seidel: R B R B on the way down, B R B R up; on graphs beyond the
 * first three sweeps each. Red and black cells (i + j + k even and odd) are kept in two arrays,
 * so that every sweep is unit stride. Cell i of a row is number m = i / 2 of its colour:
 *
 *        red    | 0 |   | 1 |   | 2 |       neighbours of cell m of one colour, all of the other:
 *        black      | 0 |   | 1 |   | 2 |   in its row m - 1 + t and m + t; in the rows beside,
 *        i        0   1   2   3   4   5     above and below m; t = (colour + j + k) & 1,
 *                                           i = 2 m + t; children of a coarse cell i: numbers
 *                                           m = i of both colours in four rows
 *
 * It takes 6 to 9 iterations for a residual of 1e-8 on boxes and pools, 4 to 19 in mazes, sprays
 * and random coefficients (64^3 to 132^3 cells; bounds: test_poisson_iterations). */

/* kernels work on whole strips of a row of one colour, and rows are padded to them; a multiple of
 * the lanes of all vectors, and the order of sums depends on it */
#define GS4I_STRIP 16
#define GS4I_SLABS 64  /* at most; gs4i_solver_setup wants two a thread */
#define GS4I_GRAPHS 24 /* at most: 2^21 cells an axis are 19 halvings beyond level 1 */
/* edge / sqrt(strongest edge of one end * of the other): below it does not join; chosen by
 * test_poisson_maze */
#define GS4I_STRONG 0.36f
#define GS4I_DENSE 200          /* nodes, at most, that are solved by Cholesky */
#define GS4I_NO_UNKNOWN (-8.0f) /* as diagonal: a cell without unknown */
/* bits of a kind */
#define GS4I_IS_LIQUID 2 /* there is an unknown */
#define GS4I_IS_OPEN 1   /* not solid */

/* The matrix in the cells l of one colour, in rows of one t:
 *     (A v)_l = (diagonal + diagonal_low)_l v_l
 *               + sum over f of face[f]_l (v_l - around_{l + beside[f]}),  f = -x +x -y +y -z +z,
 * where `around` is v of the other colour. Where c is the same on all faces it is scaled to 1 and
 * not stored; `diagonal` then has -1 for each face without flow, whose v_j is 0 in memory. */
typedef struct gs4i_stencil {
    int uniform; /* all faces are 1 */
    ptrdiff_t beside[6];
    const float *face[6], *face_low[6], *diagonal, *diagonal_low /* NULL: 0 */;
} gs4i_stencil;

/* One level on a grid. Rows, and planes at both ends, are guarded by zeros: row j of plane k
 * begins at gs4i_row_of(g, j, k). */
typedef struct gs4i_level {
    int n[3], width;             /* cells; cells of one colour in a row */
    size_t stride, plane, count; /* from row to row, from plane to plane, in all */
    int32_t *span;               /* per row: first and last strip with liquid, in cells */
    /* correction; 1 / a_ii, 0 where there is no unknown */
    float *z[2], *inverse[2];
    /* c of the face towards +x +y +z, and what float leaves of it; NULL: all are 1 */
    float *w[3][2], *w_low[3][2];
    /* h^2 d, see gs4i_stencil; level 1: and the faces to the air */
    float *diagonal[2], *diagonal_low[2];
    double *r[2];               /* residual */
    gs4i_stencil stencil[2][2]; /* of each colour, t = 0 and 1 */
} gs4i_level;

typedef struct gs4i_graph {
    /* nodes, red ones first; whether nodes of one colour are neighbours */
    int n, reds, mixed;
    int32_t *start, *to;
    float *w; /* edges of node i: start[i] to start[i + 1] */
    /* center: a_ii = air + diagonal + sum of w; inverse: 1 / a_ii, or 0 */
    float *inverse, *center, *air, *diagonal, *b, *x;
    int32_t *parent; /* in the next graph; -1: a node without edges */
    uint64_t *block; /* its place, 21 bits an axis */
    gs4i_scratch nodes, edges;
} gs4i_graph;

/* Neighbouring liquid cells of a row; `sum`: see gs4i_list_runs, then of the cells. */
typedef struct gs4i_run {
    int32_t row, begin, end, pocket;
    double sum;
} gs4i_run;

typedef struct gs4i_solver {
    gs4i_memory *memory;
    const gs4i_tasks *tasks;
    gs4i_level level[2];
    double *x[2];
    float *p[2];         /* solution, direction */
    float *red_residual; /* of level 1 */
    int32_t *parent[2];  /* of cells of level 1 in graph 0, -1: none */
    uint8_t *kind;
    size_t kind_row, kind_plane; /* bits, one cell of zeros around */
    gs4i_graph graph[GS4I_GRAPHS];
    int graphs;
    double *factor; /* lower triangle of the last graph's */
    gs4i_run *runs;
    int run_count; /* of closed pockets: neither air nor diagonal */
    int pockets;
    double *pocket; /* per pocket: sum, number of cells */
    int slabs[2], cut[2][GS4I_SLABS + 1];
    int32_t *span[2];
    int uniform, has_diagonal;
    int64_t unknowns;
    double unit, diagonal_unit; /* coefficients and diagonal are scaled by these, */
    double rhs_unit, x_unit;    /* and right-hand side and x, so that all are about 1 */
    double alpha;
    float beta;
    double *sums, *given; /* one and three per plane, added in order */
    gs4i_scratch grid, kinds, planes, cells, labels, square;
    int shape[5]; /* of `grid` */
    const char *fault, *accepted;
    double fault_value; /* what was wrong, in words */
    int returns_best;   /* where it does not converge, for as much time again */
} gs4i_solver;

GS4I_INLINE size_t gs4i_row_of(const gs4i_level *g, int j, int k)
{
    return ((size_t)(k + 1) * (size_t)(g->n[1] + 1) + (size_t)(j + 1)) * g->stride;
}

/* --- kernels: the cells of a row that have one colour ----------------------------------------- */

/* A row of a level where its liquid is: cells `at` to `at + n` of both colours, whole strips. */
typedef struct gs4i_span {
    int level, j, k, n;
    size_t at;
} gs4i_span;

GS4I_INLINE const gs4i_stencil *gs4i_stencil_of(const gs4i_level *g, const gs4i_span *row, int c)
{
    return &g->stencil[c][(c + row->j + row->k) & 1];
}

/* Terms of one face of cell l: w = face[f]_l, v_j = around_{l + beside[f]}, c = v_l. */
/* w v_j */
GS4I_INLINE float gs4i_neighbour(const gs4i_stencil *q, const float *around, int f, size_t l,
                                 int uniform)
{
    const float v = (around + q->beside[f])[l];
    return uniform ? v : q->face[f][l] * v;
}

/* w (c - v_j) */
GS4I_INLINE float gs4i_flux(const gs4i_stencil *q, float c, const float *around, int f, size_t l,
                            int uniform)
{
    const float difference = c - (around + q->beside[f])[l];
    return uniform ? difference : q->face[f][l] * difference;
}

/* w in double: two floats in the double build */
GS4I_INLINE double gs4i_exact_face(const gs4i_stencil *q, int f, size_t l)
{
#ifdef GS4_DOUBLE
    return (double)q->face[f][l] + (double)q->face_low[f][l];
#else
    return (double)q->face[f][l];
#endif
}

/* w (c - v_j) in double. Uniform: -v_j; gs4i_product adds the six c, in half the time. */
GS4I_INLINE double gs4i_exact_flux(const gs4i_stencil *q, double c, const float *around, int f,
                                   size_t l, int uniform)
{
    const double v = (double)(around + q->beside[f])[l];
    return uniform ? -v : gs4i_exact_face(q, f, l) * (c - v);
}

GS4I_INLINE double gs4i_exact_flux_of_double(const gs4i_stencil *q, double c, const double *around,
                                             int f, size_t l, int uniform)
{
    const double v = (around + q->beside[f])[l];
    return uniform ? -v : gs4i_exact_face(q, f, l) * (c - v);
}

/* Their sums over the faces, in one order. */
GS4I_INLINE float gs4i_sum_neighbours(const gs4i_stencil *q, const float *around, size_t l,
                                      int uniform)
{
    return (gs4i_neighbour(q, around, 0, l, uniform) + gs4i_neighbour(q, around, 1, l, uniform))
           + (gs4i_neighbour(q, around, 2, l, uniform) + gs4i_neighbour(q, around, 3, l, uniform))
           + (gs4i_neighbour(q, around, 4, l, uniform) + gs4i_neighbour(q, around, 5, l, uniform));
}

GS4I_INLINE float gs4i_sum_fluxes(const gs4i_stencil *q, float c, const float *around, size_t l,
                                  int uniform)
{
    return (gs4i_flux(q, c, around, 0, l, uniform) + gs4i_flux(q, c, around, 1, l, uniform))
           + (gs4i_flux(q, c, around, 2, l, uniform) + gs4i_flux(q, c, around, 3, l, uniform))
           + (gs4i_flux(q, c, around, 4, l, uniform) + gs4i_flux(q, c, around, 5, l, uniform));
}

/* A v in float, and r - A v; 0 where there is no unknown. */
GS4I_INLINE float gs4i_float_product(const gs4i_stencil *q, float c, const float *around, size_t l,
                                     int uniform)
{
    return q->diagonal[l] * c + gs4i_sum_fluxes(q, c, around, l, uniform);
}

GS4I_INLINE float gs4i_float_residual(const gs4i_stencil *q, float r, float c, const float *around,
                                      size_t l, int uniform)
{
    return (float)(q->diagonal[l] > GS4I_NO_UNKNOWN)
           * (r - gs4i_float_product(q, c, around, l, uniform));
}

/* A v in double: of v in float, of v in double. `low`: what float leaves of the diagonal. */
GS4I_INLINE double gs4i_product(const gs4i_stencil *q, const float *v, const float *around,
                                double low, size_t l, int uniform)
{
    const double c = (double)v[l];
    const double flux = (gs4i_exact_flux(q, c, around, 0, l, uniform)
                         + gs4i_exact_flux(q, c, around, 1, l, uniform))
                        + (gs4i_exact_flux(q, c, around, 2, l, uniform)
                           + gs4i_exact_flux(q, c, around, 3, l, uniform))
                        + (gs4i_exact_flux(q, c, around, 4, l, uniform)
                           + gs4i_exact_flux(q, c, around, 5, l, uniform));
    return (double)(q->diagonal[l] > GS4I_NO_UNKNOWN)
           * (((double)q->diagonal[l] + low + (uniform ? 6.0 : 0.0)) * c + flux);
}

GS4I_INLINE double gs4i_product_of_double(const gs4i_stencil *q, const double *v,
                                          const double *around, double low, size_t l, int uniform)
{
    const double c = v[l];
    const double flux = (gs4i_exact_flux_of_double(q, c, around, 0, l, uniform)
                         + gs4i_exact_flux_of_double(q, c, around, 1, l, uniform))
                        + (gs4i_exact_flux_of_double(q, c, around, 2, l, uniform)
                           + gs4i_exact_flux_of_double(q, c, around, 3, l, uniform))
                        + (gs4i_exact_flux_of_double(q, c, around, 4, l, uniform)
                           + gs4i_exact_flux_of_double(q, c, around, 5, l, uniform));
    return (double)(q->diagonal[l] > GS4I_NO_UNKNOWN)
           * (((double)q->diagonal[l] + low + (uniform ? 6.0 : 0.0)) * c + flux);
}

static double gs4i_sum_lanes(const double *v)
{
    double s[8];
    int i;
    for (i = 0; i < 8; i++) s[i] = v[i] + v[i + 8];
    return ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
}

/* z = r / a_ii: a sweep where all neighbours are 0, and Jacobi's method */
static void gs4i_scale_row(float *GS4I_RESTRICT z, const double *GS4I_RESTRICT r,
                           const float *GS4I_RESTRICT inverse, int n)
{
    int m, l;
    for (m = 0; m < n; m += GS4I_STRIP)
        for (l = m; l < m + GS4I_STRIP; l++) z[l] = (float)r[l] * inverse[l];
}

/* A Gauss-Seidel sweep of one colour: z = (r + sum of w z_j) / a_ii */
static void gs4i_smooth_row(float *GS4I_RESTRICT z, const float *GS4I_RESTRICT around,
                            const double *GS4I_RESTRICT r, const float *GS4I_RESTRICT inverse,
                            const gs4i_stencil *q, const gs4i_span *row)
{
    const gs4i_stencil here = *q; /* in registers */
    const size_t end = row->at + (size_t)row->n;
    size_t m, l;
    if (q->uniform)
        for (m = row->at; m < end; m += GS4I_STRIP)
            for (l = m; l < m + GS4I_STRIP; l++)
                z[l] = ((float)r[l] + gs4i_sum_neighbours(&here, around, l, 1)) * inverse[l];
    else
        for (m = row->at; m < end; m += GS4I_STRIP)
            for (l = m; l < m + GS4I_STRIP; l++)
                z[l] = ((float)r[l] + gs4i_sum_neighbours(&here, around, l, 0)) * inverse[l];
}

/* r - A z in float, from the beginning of `out` on; 0 where there is no unknown. */
static void gs4i_float_residual_row(float *GS4I_RESTRICT out, const float *GS4I_RESTRICT z,
                                    const float *GS4I_RESTRICT around,
                                    const double *GS4I_RESTRICT r, const gs4i_stencil *q,
                                    const gs4i_span *row)
{
    const gs4i_stencil here = *q; /* in registers */
    const size_t end = row->at + (size_t)row->n;
    size_t m, l;
    if (q->uniform)
        for (m = row->at; m < end; m += GS4I_STRIP)
            for (l = m; l < m + GS4I_STRIP; l++)
                out[l - row->at] = gs4i_float_residual(&here, (float)r[l], z[l], around, l, 1);
    else
        for (m = row->at; m < end; m += GS4I_STRIP)
            for (l = m; l < m + GS4I_STRIP; l++)
                out[l - row->at] = gs4i_float_residual(&here, (float)r[l], z[l], around, l, 0);
}

/* p.Ap from differences in float: it sets the length of a step alone. */
static double gs4i_p_dot_ap_row(const float *GS4I_RESTRICT p, const float *GS4I_RESTRICT around,
                                const gs4i_stencil *q, const gs4i_span *row)
{
    const gs4i_stencil here = *q; /* in registers */
    const size_t end = row->at + (size_t)row->n;
    double sum[GS4I_STRIP] = { 0 };
    size_t m, l;
    if (q->uniform)
        for (m = row->at; m < end; m += GS4I_STRIP)
            for (l = m; l < m + GS4I_STRIP; l++)
                sum[l - m] += (double)p[l] * (double)gs4i_float_product(&here, p[l], around, l, 1);
    else
        for (m = row->at; m < end; m += GS4I_STRIP)
            for (l = m; l < m + GS4I_STRIP; l++)
                sum[l - m] += (double)p[l] * (double)gs4i_float_product(&here, p[l], around, l, 0);
    return gs4i_sum_lanes(sum);
}

static double gs4i_square_row(const double *GS4I_RESTRICT r, int n)
{
    double sum[GS4I_STRIP] = { 0 };
    int m, l;
    for (m = 0; m < n; m += GS4I_STRIP)
        for (l = 0; l < GS4I_STRIP; l++) sum[l] += r[m + l] * r[m + l];
    return gs4i_sum_lanes(sum);
}

static const float gs4i_zeros[GS4I_STRIP] = { 0 };

/* x += alpha p, r -= alpha A p; gives r.r */
static double gs4i_update_row(double *GS4I_RESTRICT x, double *GS4I_RESTRICT r, double alpha,
                              const float *GS4I_RESTRICT p, const float *GS4I_RESTRICT around,
                              const gs4i_stencil *q, const gs4i_span *row)
{
    const size_t end = row->at + (size_t)row->n;
    size_t m, l;
    for (m = row->at; m < end; m += GS4I_STRIP) {
        const float *low = q->diagonal_low ? q->diagonal_low + m : gs4i_zeros;
        if (q->uniform)
            for (l = 0; l < GS4I_STRIP; l++)
                r[m + l] -= alpha * gs4i_product(q, p, around, (double)low[l], m + l, 1);
        else
            for (l = 0; l < GS4I_STRIP; l++)
                r[m + l] -= alpha * gs4i_product(q, p, around, (double)low[l], m + l, 0);
    }
    for (m = row->at; m < end; m++) x[m] += alpha * (double)p[m];
    return gs4i_square_row(r + row->at, row->n);
}

/* r -= A x; gives r.r */
static double gs4i_residual_row(double *GS4I_RESTRICT r, const double *GS4I_RESTRICT x,
                                const double *GS4I_RESTRICT around, const gs4i_stencil *q,
                                const gs4i_span *row)
{
    const size_t end = row->at + (size_t)row->n;
    size_t m, l;
    for (m = row->at; m < end; m += GS4I_STRIP) {
        const float *low = q->diagonal_low ? q->diagonal_low + m : gs4i_zeros;
        if (q->uniform)
            for (l = 0; l < GS4I_STRIP; l++)
                r[m + l] -= gs4i_product_of_double(q, x, around, (double)low[l], m + l, 1);
        else
            for (l = 0; l < GS4I_STRIP; l++)
                r[m + l] -= gs4i_product_of_double(q, x, around, (double)low[l], m + l, 0);
    }
    return gs4i_square_row(r + row->at, row->n);
}

static double gs4i_dot_row(const double *GS4I_RESTRICT r, const float *GS4I_RESTRICT z, int n)
{
    double sum[GS4I_STRIP] = { 0 };
    int m, l;
    for (m = 0; m < n; m += GS4I_STRIP)
        for (l = 0; l < GS4I_STRIP; l++) sum[l] += r[m + l] * (double)z[m + l];
    return gs4i_sum_lanes(sum);
}

static void gs4i_update_direction(float *GS4I_RESTRICT p, const float *GS4I_RESTRICT z, float beta,
                                  int n)
{
    int m, l;
    for (m = 0; m < n; m += GS4I_STRIP)
        for (l = m; l < m + GS4I_STRIP; l++) p[l] = z[l] + beta * p[l];
}

/* Adds cell m of a fine row to coarse cell m, in two colours. */
static void gs4i_add_parents(double *GS4I_RESTRICT even, double *GS4I_RESTRICT odd,
                             const float *GS4I_RESTRICT fine, int n)
{
    int m;
    for (m = 0; m < n / 2; m++) {
        even[m] += (double)fine[2 * m];
        odd[m] += (double)fine[2 * m + 1];
    }
}

static void gs4i_add_children(float *GS4I_RESTRICT z, const float *GS4I_RESTRICT inverse,
                              const float *GS4I_RESTRICT even, const float *GS4I_RESTRICT odd,
                              int n)
{
    int m;
    for (m = 0; m < n / 2; m++) {
        z[2 * m] = inverse[2 * m] > 0 ? z[2 * m] + even[m] : 0;
        z[2 * m + 1] = inverse[2 * m + 1] > 0 ? z[2 * m + 1] + odd[m] : 0;
    }
}

/* --- passes: what is done to a row, adding to `sum` where something is summed ----------------- */

typedef void (*gs4i_pass_fn)(gs4i_solver *s, const gs4i_span *row, double *sum);

/* The first red sweep: black z are 0. */
static void gs4i_pass_first_red(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    const gs4i_level *g = &s->level[row->level];
    (void)sum;
    gs4i_scale_row(g->z[0] + row->at, g->r[0] + row->at, g->inverse[0] + row->at, row->n);
}

static void gs4i_smooth(const gs4i_solver *s, const gs4i_span *row, int c)
{
    const gs4i_level *g = &s->level[row->level];
    gs4i_smooth_row(g->z[c], g->z[!c], g->r[c], g->inverse[c], gs4i_stencil_of(g, row, c), row);
}

static void gs4i_pass_red(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    (void)sum;
    gs4i_smooth(s, row, 0);
}

static void gs4i_pass_black(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    (void)sum;
    gs4i_smooth(s, row, 1);
}

/* r - A z in red cells; in black cells it is 0 after their sweep. */
static void gs4i_pass_red_residual(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    const gs4i_level *g = &s->level[row->level];
    (void)sum;
    gs4i_float_residual_row(s->red_residual + row->at, g->z[0], g->z[1], g->r[0],
                            gs4i_stencil_of(g, row, 0), row);
}

/* Adds red residuals of a row of level 0 to a row of level 1, which the first of its four rows
 * clears: this pass is given empty rows, too. */
static void gs4i_pass_restrict(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    const gs4i_level *g = &s->level[0], *h = &s->level[1];
    const size_t up = gs4i_row_of(h, row->j / 2, row->k / 2);
    const int even = (row->j / 2 + row->k / 2) & 1;
    float out[16 * GS4I_STRIP];
    gs4i_span part = *row;
    int c;
    (void)sum;
    if (!(row->j & 1) && !(row->k & 1))
        for (c = 0; c < 2; c++) memset(h->r[c] + up, 0, (size_t)h->width * sizeof(double));
    for (; part.at < row->at + (size_t)row->n; part.at += (size_t)part.n) {
        const size_t left = row->at + (size_t)row->n - part.at,
                     to = up + (part.at - gs4i_row_of(g, row->j, row->k)) / 2;
        part.n = left < 16 * GS4I_STRIP ? (int)left : 16 * GS4I_STRIP;
        gs4i_float_residual_row(out, g->z[0], g->z[1], g->r[0], gs4i_stencil_of(g, row, 0), &part);
        gs4i_add_parents(h->r[even] + to, h->r[!even] + to, out, part.n);
    }
}

/* Adds corrections of level 1 to red cells; the sweep that follows sets the black ones. */
static void gs4i_pass_prolong(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    const gs4i_level *g = &s->level[0], *h = &s->level[1];
    const int even = (row->j / 2 + row->k / 2) & 1;
    const size_t from =
        gs4i_row_of(h, row->j / 2, row->k / 2) + (row->at - gs4i_row_of(g, row->j, row->k)) / 2;
    (void)sum;
    gs4i_add_children(g->z[0] + row->at, g->inverse[0] + row->at, h->z[even] + from,
                      h->z[!even] + from, row->n);
}

/* The same from graph 0 to level 1. */
static void gs4i_pass_prolong_graph(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    const int32_t *parent = s->parent[0] + row->at;
    float *z = s->level[1].z[0] + row->at;
    int m;
    (void)sum;
    for (m = 0; m < row->n; m++)
        if (parent[m] >= 0) z[m] += s->graph[0].x[parent[m]];
}

/* r.z */
static void gs4i_pass_dot(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    const gs4i_level *g = &s->level[0];
    int c;
    for (c = 0; c < 2; c++) *sum += gs4i_dot_row(g->r[c] + row->at, g->z[c] + row->at, row->n);
}

static void gs4i_pass_direction(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    int c;
    (void)sum;
    for (c = 0; c < 2; c++)
        gs4i_update_direction(s->p[c] + row->at, s->level[0].z[c] + row->at, s->beta, row->n);
}

static void gs4i_pass_p_dot_ap(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    int c;
    for (c = 0; c < 2; c++) {
        *sum += gs4i_p_dot_ap_row(s->p[c], s->p[!c], gs4i_stencil_of(&s->level[0], row, c), row);
    }
}

static void gs4i_pass_update(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    int c;
    for (c = 0; c < 2; c++) {
        *sum += gs4i_update_row(s->x[c], s->level[0].r[c], s->alpha, s->p[c], s->p[!c],
                                gs4i_stencil_of(&s->level[0], row, c), row);
    }
}

static void gs4i_pass_residual(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    int c;
    for (c = 0; c < 2; c++) {
        *sum += gs4i_residual_row(s->level[0].r[c], s->x[c], s->x[!c],
                                  gs4i_stencil_of(&s->level[0], row, c), row);
    }
}

static void gs4i_pass_norm(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    int c;
    for (c = 0; c < 2; c++) *sum += gs4i_square_row(s->level[0].r[c] + row->at, row->n);
}

static void gs4i_pass_jacobi(gs4i_solver *s, const gs4i_span *row, double *sum)
{
    const gs4i_level *g = &s->level[0];
    int c;
    (void)sum;
    for (c = 0; c < 2; c++)
        gs4i_scale_row(g->z[c] + row->at, g->r[c] + row->at, g->inverse[c] + row->at, row->n);
}

/* --- wavefronts: passes one behind the other through the planes -------------------------------- *
 *
 * Pass q needs pass q - 1 in planes k - 1, k, k + 1; the first needs nothing that a pass writes.
 * So pass q does plane step - q while that is in the cache. With slabs there are two rounds: each
 * task does first what needs nothing of another slab, then what is left at the cuts:
 *
 *     pass 0   |--------------------||--------------------|
 *     pass 1   |-------------------\  /-------------------|        first round: \ cut /
 *     pass 2   |------------------\ || /------------------|        second: between \ and /
 *
 * Every cell sees the same numbers whatever the slabs. The pass that restricts takes planes by
 * two. */

typedef struct gs4i_wavefront {
    gs4i_solver *s;
    int level;
    const gs4i_pass_fn *pass;
    int count;
} gs4i_wavefront;

/* A pass through a plane; what it sums is summed in the order of rows. */
static void gs4i_wavefront_plane(const gs4i_wavefront *w, int q, int k)
{
    const gs4i_level *g = &w->s->level[w->level];
    const int32_t *span = g->span + 2 * (size_t)k * (size_t)g->n[1];
    const gs4i_pass_fn pass = w->pass[q];
    gs4i_span row;
    double sum = 0;
    row.level = w->level;
    row.k = k;
    for (row.j = 0; row.j < g->n[1]; row.j++, span += 2) {
        row.n = span[1] - span[0];
        row.at = gs4i_row_of(g, row.j, k) + (size_t)span[0];
        if (row.n > 0 || pass == gs4i_pass_restrict) pass(w->s, &row, &sum);
    }
    w->s->sums[k] = sum;
}

GS4I_INLINE int gs4i_even_plane(const gs4i_wavefront *w, int q, int k, int up)
{
    return w->pass[q] != gs4i_pass_restrict ? k : up ? (k + 1) & ~1 : k & ~1;
}

static void gs4i_wavefront_slab(int index, void *context)
{
    const gs4i_wavefront *w = (const gs4i_wavefront *)context;
    const int a = w->s->cut[w->level][index], b = w->s->cut[w->level][index + 1],
              first = index == 0, last = index == w->s->slabs[w->level] - 1;
    int step, q;
    for (step = a; step < b + w->count; step++)
        for (q = 0; q < w->count; q++) {
            const int k = step - q;
            if (k >= (first ? a : gs4i_even_plane(w, q, a + q, 1))
                && k < (last ? b : gs4i_even_plane(w, q, b - q, 0)))
                gs4i_wavefront_plane(w, q, k);
        }
}

static void gs4i_wavefront_cut(int index, void *context)
{
    const gs4i_wavefront *w = (const gs4i_wavefront *)context;
    const int cut = w->s->cut[w->level][index + 1];
    int q, k;
    for (q = 1; q < w->count; q++)
        for (k = gs4i_even_plane(w, q, cut - q, 0); k < gs4i_even_plane(w, q, cut + q, 1); k++)
            gs4i_wavefront_plane(w, q, k);
}

static void gs4i_wavefront_run(gs4i_solver *s, int level, const gs4i_pass_fn *pass, int count)
{
    gs4i_wavefront w;
    w.s = s;
    w.level = level;
    w.pass = pass;
    w.count = count;
    gs4i_parallel_for(s->tasks, s->slabs[level], gs4i_wavefront_slab, &w);
    if (count > 1) gs4i_parallel_for(s->tasks, s->slabs[level] - 1, gs4i_wavefront_cut, &w);
}

static double gs4i_sum_planes(const gs4i_solver *s)
{
    double sum = 0;
    int k;
    for (k = 0; k < s->level[0].n[2]; k++) sum += s->sums[k];
    return sum;
}

/* --- the cycle -------------------------------------------------------------------------------- */

GS4I_INLINE void gs4i_relax_node(gs4i_graph *g, int i)
{
    float sum = g->b[i];
    int e;
    for (e = g->start[i]; e < g->start[i + 1]; e++) sum += g->w[e] * g->x[g->to[e]];
    g->x[i] = sum * g->inverse[i];
}

static void gs4i_graph_forward(gs4i_graph *g, int sweeps)
{
    int i, q;
    for (q = 0; q < sweeps; q++)
        for (i = 0; i < g->n; i++) gs4i_relax_node(g, i);
}

static void gs4i_graph_backward(gs4i_graph *g, int sweeps)
{
    int i, q;
    for (q = 0; q < sweeps; q++)
        for (i = g->n - 1; i >= 0; i--) gs4i_relax_node(g, i);
}

/* Residuals to the next graph. Where neighbours always differ in colour, those of black nodes
 * are 0 after their sweep. */
static void gs4i_graph_restrict(const gs4i_graph *g, gs4i_graph *up)
{
    int i, e;
    memset(up->b, 0, (size_t)up->n * sizeof(float));
    for (i = 0; i < (g->mixed ? g->n : g->reds); i++) {
        float sum = g->b[i] - g->center[i] * g->x[i];
        if (g->parent[i] < 0) continue;
        for (e = g->start[i]; e < g->start[i + 1]; e++) sum += g->w[e] * g->x[g->to[e]];
        up->b[g->parent[i]] += sum;
    }
}

static void gs4i_graph_prolong(gs4i_graph *g, const gs4i_graph *up)
{
    int i;
    for (i = 0; i < (g->mixed ? g->n : g->reds); i++)
        if (g->parent[i] >= 0) g->x[i] += up->x[g->parent[i]];
}

/* F F^T x = b with the Cholesky factor F; a row whose pivot was skipped has 0 on its diagonal. */
static void gs4i_graph_solve(gs4i_graph *g, const double *factor)
{
    const int n = g->n;
    double y[GS4I_DENSE];
    int i, j;
    for (i = 0; i < n; i++) {
        const double *row = factor + (size_t)i * (size_t)n;
        double sum = (double)g->b[i];
        for (j = 0; j < i; j++) sum -= row[j] * y[j];
        y[i] = row[i] > 0 ? sum / row[i] : 0;
    }
    for (i = n - 1; i >= 0; i--) {
        const double *row = factor + (size_t)i * (size_t)n;
        y[i] = row[i] > 0 ? y[i] / row[i] : 0;
        for (j = 0; j < i; j++) y[j] -= row[j] * y[i];
        g->x[i] = (float)y[i];
    }
}

static void gs4i_graph_cycles(gs4i_solver *s)
{
    int q;
    for (q = 0; q < s->graphs - 1; q++) {
        gs4i_graph *g = &s->graph[q];
        memset(g->x, 0, (size_t)g->n * sizeof(float));
        /* beyond graph 0 a third sweep is cheap, and spares iterations in mazes */
        gs4i_graph_forward(g, q ? 3 : 2);
        gs4i_graph_restrict(g, &s->graph[q + 1]);
    }
    gs4i_graph_solve(&s->graph[q], s->factor);
    while (--q >= 0) {
        gs4i_graph *g = &s->graph[q];
        gs4i_graph_prolong(g, &s->graph[q + 1]);
        gs4i_graph_backward(g, q ? 3 : 2);
    }
}

/* Of a plane of blocks: no group reaches into another. */
static void gs4i_restrict_to_graph(int bk, void *context)
{
    gs4i_solver *s = (gs4i_solver *)context;
    const gs4i_level *g = &s->level[1];
    float *b = s->graph[0].b;
    int j, k, m;
    for (k = 2 * bk; k < 2 * bk + 2 && k < g->n[2]; k++)
        for (j = 0; j < g->n[1]; j++) {
            const int32_t *span = g->span + 2 * (k * g->n[1] + j);
            const size_t row = gs4i_row_of(g, j, k);
            for (m = span[0]; m < span[1]; m++) {
                const int32_t parent = s->parent[0][row + (size_t)m];
                if (parent >= 0) b[parent] += s->red_residual[row + (size_t)m];
            }
        }
}

/* z = M r with M symmetric, positive definite and about the inverse of A; gives r.z. */
static double gs4i_cycle(gs4i_solver *s)
{
    static const gs4i_pass_fn down[] = { gs4i_pass_first_red, gs4i_pass_black, gs4i_pass_red,
                                         gs4i_pass_black, gs4i_pass_restrict };
    static const gs4i_pass_fn down1[] = { gs4i_pass_first_red, gs4i_pass_black, gs4i_pass_red,
                                          gs4i_pass_black, gs4i_pass_red_residual };
    static const gs4i_pass_fn up1[] = { gs4i_pass_prolong_graph, gs4i_pass_black, gs4i_pass_red,
                                        gs4i_pass_black, gs4i_pass_red };
    static const gs4i_pass_fn up[] = { gs4i_pass_prolong, gs4i_pass_black, gs4i_pass_red,
                                       gs4i_pass_black,   gs4i_pass_red,   gs4i_pass_dot };
    gs4i_wavefront_run(s, 0, down, 5);
    gs4i_wavefront_run(s, 1, down1, 5);
    memset(s->graph[0].b, 0, (size_t)s->graph[0].n * sizeof(float));
    gs4i_parallel_for(s->tasks, (s->level[1].n[2] + 1) / 2, gs4i_restrict_to_graph, s);
    gs4i_graph_cycles(s);
    gs4i_wavefront_run(s, 1, up1, 5);
    gs4i_wavefront_run(s, 0, up, 6);
    return gs4i_sum_planes(s);
}

/* --- setup: memory ---------------------------------------------------------------------------- */

#define GS4I_CHUNK ((size_t)1 << 20)

typedef struct gs4i_clearing {
    char *at;
    size_t bytes;
} gs4i_clearing;

static void gs4i_clear_chunk(int index, void *context)
{
    const gs4i_clearing *c = (const gs4i_clearing *)context;
    const size_t begin = (size_t)index * GS4I_CHUNK;
    memset(c->at + begin, 0, c->bytes - begin < GS4I_CHUNK ? c->bytes - begin : GS4I_CHUNK);
}

/* In parallel: fresh pages cost more than all the rest of a setup. */
static void gs4i_clear(gs4i_solver *s, void *at, size_t bytes)
{
    gs4i_clearing c;
    c.at = (char *)at;
    c.bytes = bytes;
    gs4i_parallel_for(s->tasks, (int)((bytes + GS4I_CHUNK - 1) / GS4I_CHUNK), gs4i_clear_chunk, &c);
}

static void gs4i_release(gs4i_memory *memory, gs4i_scratch *c)
{
    gs4i_free(memory, c->data, c->bytes, 1);
    c->data = NULL;
    c->bytes = 0;
}

/* Room for `bytes`. What was there is lost if the room has to grow. Zero if it has grown, or if
 * `fresh`. */
static int gs4i_reserve(gs4i_solver *s, gs4i_scratch *c, size_t bytes, int fresh)
{
    if (!c->data || c->bytes < bytes) {
        gs4i_release(s->memory, c);
        if (bytes > SIZE_MAX / 2) return GS4_ERROR_MEMORY;
        c->data = s->memory->hook.alloc_fn(bytes ? bytes : 1, 64, s->memory->hook.user);
        if (!c->data) return GS4_ERROR_MEMORY;
        c->bytes = bytes ? bytes : 1;
        s->memory->bytes += c->bytes;
        fresh = 1;
    }
    if (fresh) gs4i_clear(s, c->data, bytes);
    return GS4_OK;
}

/* The next `count` elements of an arena; NULL if `base` is, which adds up what is needed. */
static void *gs4i_carve(char *base, size_t *used, size_t count, size_t size)
{
    void *p = base ? base + *used : NULL;
    *used += (count * size + 63) / 64 * 64;
    return p;
}

static void gs4i_carve_two(char *base, size_t *used, size_t count, float **two)
{
    int c;
    for (c = 0; c < 2; c++) two[c] = (float *)gs4i_carve(base, used, count, sizeof(float));
}

static void gs4i_shape_level(gs4i_level *g, const int n[3])
{
    memset(g, 0, sizeof *g);
    memcpy(g->n, n, sizeof g->n);
    g->width = (n[0] + 1) / 2;
    g->stride = ((size_t)g->width + GS4I_STRIP) / GS4I_STRIP * GS4I_STRIP;
    g->plane = g->stride * (size_t)(n[1] + 1);
    g->count = g->plane * (size_t)(n[2] + 2);
}

static void gs4i_set_stencil(gs4i_level *g, int c, int t)
{
    const ptrdiff_t low[3] = { t - 1, -(ptrdiff_t)g->stride, -(ptrdiff_t)g->plane },
                    high[3] = { t, (ptrdiff_t)g->stride, (ptrdiff_t)g->plane };
    gs4i_stencil *q = &g->stencil[c][t];
    int a;
    q->uniform = !g->w[0][0];
    q->diagonal = g->diagonal[c];
    q->diagonal_low = g->diagonal_low[c];
    for (a = 0; a < 3; a++) {
        q->beside[2 * a] = low[a];
        q->beside[2 * a + 1] = high[a];
        if (g->w[a][c]) {
            q->face[2 * a] = g->w[a][!c] + low[a];
            q->face[2 * a + 1] = g->w[a][c];
        }
        if (g->w_low[a][c]) {
            q->face_low[2 * a] = g->w_low[a][!c] + low[a];
            q->face_low[2 * a + 1] = g->w_low[a][c];
        }
    }
}

/* All arrays of both levels; gives their bytes. */
static size_t gs4i_lay_out(gs4i_solver *s, char *base)
{
    size_t used = 0;
    int l, c, a;
    for (l = 0; l < 2; l++) {
        gs4i_level *g = &s->level[l];
        gs4i_carve_two(base, &used, g->count, g->z);
        gs4i_carve_two(base, &used, g->count, g->inverse);
        for (c = 0; c < 2; c++)
            g->r[c] = (double *)gs4i_carve(base, &used, g->count, sizeof(double));
        if (l == 1 || !s->uniform)
            for (a = 0; a < 3; a++) gs4i_carve_two(base, &used, g->count, g->w[a]);
        if (l == 0 && !s->uniform && sizeof(gs4_real) == 8)
            for (a = 0; a < 3; a++) gs4i_carve_two(base, &used, g->count, g->w_low[a]);
        gs4i_carve_two(base, &used, g->count, g->diagonal);
        if (l == 0 && s->has_diagonal) gs4i_carve_two(base, &used, g->count, g->diagonal_low);
    }
    gs4i_carve_two(base, &used, s->level[0].count, s->p);
    for (c = 0; c < 2; c++)
        s->x[c] = (double *)gs4i_carve(base, &used, s->level[0].count, sizeof(double));
    s->red_residual = (float *)gs4i_carve(base, &used, s->level[1].count, sizeof(float));
    s->parent[0] = (int32_t *)gs4i_carve(base, &used, s->level[1].count, sizeof(int32_t));
    /* of black cells while setting up alone */
    s->parent[1] = (int32_t *)(void *)s->red_residual;
    return used;
}

/* Arrays of both levels; what a setup does not write is zero. */
static int gs4i_reserve_levels(gs4i_solver *s)
{
    gs4i_level *g = s->level;
    const int shape[5] = { g->n[0], g->n[1], g->n[2], s->uniform, s->has_diagonal },
              fresh = memcmp(shape, s->shape, sizeof shape) != 0;
    int n[3], a, c;
    for (a = 0; a < 3; a++) n[a] = (g->n[a] + 1) / 2;
    gs4i_shape_level(&g[1], n);
    memset(s->shape, 0, sizeof s->shape);
    if (gs4i_reserve(s, &s->grid, gs4i_lay_out(s, NULL), fresh) != GS4_OK) return GS4_ERROR_MEMORY;
    memcpy(s->shape, shape, sizeof shape);
    gs4i_lay_out(s, (char *)s->grid.data);
    for (c = 0; c < 8; c++) gs4i_set_stencil(&s->level[c >> 2], c >> 1 & 1, c & 1);
    for (c = 0; c < 2 && !fresh; c++) {
        gs4i_clear(s, g[0].z[c], g[0].count * sizeof(float));
        gs4i_clear(s, s->p[c], g[0].count * sizeof(float));
        gs4i_clear(s, g[1].z[c], g[1].count * sizeof(float));
        gs4i_clear(s, g[1].diagonal[c], g[1].count * sizeof(float));
        for (a = 0; a < 3; a++) gs4i_clear(s, g[1].w[a][c], g[1].count * sizeof(float));
    }
    return GS4_OK;
}

/* --- setup: what is given --------------------------------------------------------------------- */

#ifdef GS4_DOUBLE
typedef uint64_t gs4i_bits;
#else
typedef uint32_t gs4i_bits;
#endif

typedef struct gs4i_range {
    double low, high, least /* above 0 */, diagonal;
    int64_t unknowns;
    const char *fault;
    double value;
} gs4i_range;
typedef struct gs4i_setup {
    gs4i_solver *s;
    const gs4_poisson_desc *d;
    gs4i_range *range;
    int32_t *counts;
} gs4i_setup;

#define GS4I_CONDUCTS(a, b) ((a) & (b)&GS4I_IS_OPEN && ((a) | (b)) & GS4I_IS_LIQUID)

GS4I_INLINE const uint8_t *gs4i_kinds_of(const gs4i_solver *s, int j, int k)
{
    return s->kind + (size_t)(k + 1) * s->kind_plane + (size_t)(j + 1) * s->kind_row + 1;
}

static void gs4i_read_kinds(int k, void *context)
{
    const gs4i_setup *u = (const gs4i_setup *)context;
    static const uint8_t bits[3] = { GS4I_IS_OPEN, GS4I_IS_OPEN | GS4I_IS_LIQUID, 0 };
    const int *n = u->d->cells;
    gs4i_range *range = &u->range[k];
    int64_t unknowns = 0;
    int i, j;
    for (j = 0; j < n[1]; j++) {
        const uint8_t *from = u->d->kind + ((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)n[0];
        uint8_t *to = u->s->kind + (gs4i_kinds_of(u->s, j, k) - u->s->kind);
        for (i = 0; i < n[0]; i++) {
            if (from[i] > GS4_CELL_SOLID) {
                range->fault = "kind[] holds ";
                range->value = from[i];
                return;
            }
            to[i] = bits[from[i]];
            unknowns += from[i] == GS4_CELL_LIQUID;
        }
    }
    range->unknowns = unknowns;
}

/* Least, least above 0 and largest coefficient of the faces that conduct, as bits. The bits of
 * floats that are not negative are in the order of the numbers. Negative ones, infinity and NaN
 * are above all finite ones. */
static void gs4i_range_of_bits(const gs4_real *GS4I_RESTRICT face,
                               const uint8_t *GS4I_RESTRICT kind,
                               const uint8_t *GS4I_RESTRICT other, int n,
                               gs4i_bits *GS4I_RESTRICT range)
{
    gs4i_bits low = range[0], least = range[1], high = range[2];
    int i;
    for (i = 0; i < n; i++) {
        const gs4i_bits mask = (gs4i_bits)0
                               - (gs4i_bits)(kind[i] & other[i] & GS4I_IS_OPEN
                                             & (kind[i] | other[i]) / GS4I_IS_LIQUID);
        const gs4_real c = face[i] + 0; /* no -0 */
        gs4i_bits b;
        memcpy(&b, &c, sizeof b);
        low = (b | ~mask) < low ? b | ~mask : low;
        least = ((b - 1) | ~mask) < least ? (b - 1) | ~mask : least;
        high = (b & mask) > high ? b & mask : high;
    }
    range[0] = low;
    range[1] = least;
    range[2] = high;
}

static void gs4i_range_of_faces(gs4i_range *range, const gs4_real *face, const uint8_t *kind,
                                const uint8_t *other, int n)
{
    gs4i_bits bits[3] = { ~(gs4i_bits)0, ~(gs4i_bits)0, 0 };
    gs4_real low, least, high;
    int i;
    gs4i_range_of_bits(face, kind, other, n, bits);
    memcpy(&high, &bits[2], sizeof high);
    if (!(high >= 0 && high < GS4I_HUGE)) {
        for (i = 0; GS4I_CONDUCTS(kind[i], other[i]) == 0 || (face[i] >= 0 && face[i] < GS4I_HUGE);
             i++) {
        }
        range->fault = "coefficient[] holds ";
        range->value = (double)face[i];
        return;
    }
    if ((double)high > range->high) range->high = (double)high;
    if (~bits[0]) {
        memcpy(&low, &bits[0], sizeof low);
        if ((double)low < range->low) range->low = (double)low;
    }
    if (~bits[1]) {
        bits[1]++;
        memcpy(&least, &bits[1], sizeof least);
        if ((double)least < range->least) range->least = (double)least;
    }
}

/* Range of all coefficients and diagonals that matter; of faces those towards + */
static void gs4i_range_of_plane(int k, void *context)
{
    const gs4i_setup *u = (const gs4i_setup *)context;
    const gs4_poisson_desc *d = u->d;
    const size_t nx = (size_t)d->cells[0], ny = (size_t)d->cells[1];
    const size_t step[3] = { 1, u->s->kind_row, u->s->kind_plane };
    gs4i_range *range = &u->range[k];
    size_t i, j;
    int a;
    for (j = 0; j < ny; j++) {
        const size_t row = (size_t)k * ny + j;
        const size_t face[3] = { row * (nx + 1) + 1, ((size_t)k * (ny + 1) + j + 1) * nx,
                                 (row + ny) * nx };
        const uint8_t *kind = gs4i_kinds_of(u->s, (int)j, k);
        for (a = 0; a < 3; a++) {
            if (!d->coefficient[a]) continue;
            gs4i_range_of_faces(range, d->coefficient[a] + face[a], kind, kind + step[a], (int)nx);
            if (range->fault) return;
        }
        for (i = 0; i < nx && d->diagonal; i++)
            if (kind[i] & GS4I_IS_LIQUID) {
                const double m = (double)d->diagonal[row * nx + i];
                if (!(m >= 0 && m < (double)GS4I_HUGE)) {
                    range->fault = "diagonal[] holds ";
                    range->value = m;
                    return;
                }
                if (m > range->diagonal) range->diagonal = m;
            }
    }
}

static int gs4i_fault(gs4i_solver *s, const char *what, double value, const char *accepted)
{
    s->fault = what;
    s->fault_value = value;
    s->accepted = accepted;
    return GS4_ERROR_ARGUMENT;
}

/* Scales, so that coefficients and diagonals are about 1. Uniform: all c are the same, and level 0
 * stores none; it takes half the memory. */
static int gs4i_choose_units(gs4i_solver *s, const gs4_poisson_desc *d, const gs4i_range *range)
{
    const double h2 = (double)d->cell_size * (double)d->cell_size;
    gs4i_range all;
    int k, exponent = 0;
    memset(&all, 0, sizeof all);
    all.low = all.least = DBL_MAX;
    if (!d->coefficient[0] || !d->coefficient[1] || !d->coefficient[2])
        all.low = all.high = all.least = 1;
    s->unknowns = 0;
    for (k = 0; k < d->cells[2]; k++) {
        if (range[k].fault)
            return gs4i_fault(s, range[k].fault, range[k].value,
                              "; it must be 0 or a finite number above that is not absurdly large");
        if (range[k].low < all.low) all.low = range[k].low;
        if (range[k].high > all.high) all.high = range[k].high;
        if (range[k].least < all.least) all.least = range[k].least;
        if (range[k].diagonal > all.diagonal) all.diagonal = range[k].diagonal;
        s->unknowns += range[k].unknowns;
    }
    all.diagonal *= h2;
    s->has_diagonal = all.diagonal > 0;
    s->uniform = all.high > 0 && all.low == all.high && all.diagonal < 1e9 * all.high;
    if (all.high > 0 && all.least < 1e-30 * all.high)
        return gs4i_fault(s, "the smallest coefficient above 0, over the largest, is ",
                          all.least / all.high,
                          "; it must be at least 1e-30, use 0 for what does not conduct");
    frexp(all.high > all.diagonal ? all.high : all.diagonal, &exponent);
    s->unit = s->uniform ? 1 / all.high : ldexp(1, -exponent);
    s->diagonal_unit = h2 * s->unit;
    return GS4_OK;
}

/* Reads kinds and ranges, chooses units, and gets memory. */
static int gs4i_read_problem(gs4i_setup *u)
{
    gs4i_solver *s = u->s;
    const int *n = u->d->cells;
    size_t used = 0, rows;
    char *base = NULL;
    int k, l, laid;
    gs4i_shape_level(&s->level[0], n);
    s->kind_row = (size_t)n[0] + 2;
    s->kind_plane = s->kind_row * (size_t)(n[1] + 2);
    if (gs4i_reserve(s, &s->kinds, s->kind_plane * (size_t)(n[2] + 2), 1) != GS4_OK)
        return GS4_ERROR_MEMORY;
    s->kind = (uint8_t *)s->kinds.data;
    for (laid = 0; laid < 2; laid++) {
        used = 0;
        for (l = 0; l < 2; l++) {
            rows = (size_t)(l ? (n[1] + 1) / 2 : n[1]) * (size_t)(l ? (n[2] + 1) / 2 : n[2]);
            s->span[l] = (int32_t *)gs4i_carve(base, &used, 2 * rows, sizeof(int32_t));
        }
        s->sums = (double *)gs4i_carve(base, &used, (size_t)n[2], sizeof(double));
        s->given = (double *)gs4i_carve(base, &used, 3 * (size_t)n[2], sizeof(double));
        u->range = (gs4i_range *)gs4i_carve(base, &used, (size_t)n[2], sizeof(gs4i_range));
        u->counts = (int32_t *)gs4i_carve(base, &used, (size_t)n[2] + 2, sizeof(int32_t));
        if (!laid && gs4i_reserve(s, &s->planes, used, 1) != GS4_OK) return GS4_ERROR_MEMORY;
        base = (char *)s->planes.data;
    }
    for (k = 0; k < n[2]; k++) u->range[k].low = u->range[k].least = DBL_MAX;
    gs4i_parallel_for(s->tasks, n[2], gs4i_read_kinds, u);
    for (k = 0; k < n[2]; k++)
        if (u->range[k].fault)
            return gs4i_fault(s, u->range[k].fault, u->range[k].value,
                              ", which is none of gs4_cell");
    gs4i_parallel_for(s->tasks, n[2], gs4i_range_of_plane, u);
    if (gs4i_choose_units(s, u->d, u->range) != GS4_OK) return GS4_ERROR_ARGUMENT;
    if (gs4i_reserve_levels(s) != GS4_OK) return GS4_ERROR_MEMORY;
    for (l = 0; l < 2; l++) s->level[l].span = s->span[l];
    return GS4_OK;
}

/* --- setup: both levels on grids -------------------------------------------------------------- */

/* The given arrays at a row; faces f = -x +x -y +y -z +z, `beside`: to the kinds behind them. */
typedef struct gs4i_given_row {
    const uint8_t *kind;
    const gs4_real *face[6], *diagonal;
    ptrdiff_t beside[6];
    double unit, diagonal_unit;
    int uniform;
} gs4i_given_row;

static void gs4i_find_row(gs4i_given_row *q, const gs4i_solver *s, const gs4_poisson_desc *d, int j,
                          int k)
{
    const size_t nx = (size_t)d->cells[0], ny = (size_t)d->cells[1],
                 row = (size_t)k * ny + (size_t)j;
    const size_t low[3] = { row * (nx + 1), ((size_t)k * (ny + 1) + (size_t)j) * nx, row * nx },
                 high[3] = { 1, nx, nx * ny };
    const ptrdiff_t step[3] = { 1, (ptrdiff_t)s->kind_row, (ptrdiff_t)s->kind_plane };
    int a;
    q->kind = gs4i_kinds_of(s, j, k);
    q->diagonal = d->diagonal ? d->diagonal + row * nx : NULL;
    q->uniform = s->uniform;
    q->unit = s->uniform ? 1 : s->unit;
    q->diagonal_unit = s->diagonal_unit;
    for (a = 0; a < 3; a++) {
        const gs4_real *c = s->uniform ? NULL : d->coefficient[a];
        q->face[2 * a] = c ? c + low[a] : NULL;
        q->face[2 * a + 1] = c ? c + low[a] + high[a] : NULL;
        q->beside[2 * a] = -step[a];
        q->beside[2 * a + 1] = step[a];
    }
}

GS4I_INLINE double gs4i_face_of(const gs4i_given_row *q, int i, int f)
{
    if (!GS4I_CONDUCTS(q->kind[i], q->kind[i + q->beside[f]])) return 0;
    return q->face[f] ? (double)q->face[f][i] * q->unit : q->unit;
}

/* Whether eight cells of a row are liquid; and all their neighbours, too. */
GS4I_INLINE int gs4i_is_wet(const uint8_t *v)
{
    uint64_t eight;
    memcpy(&eight, v, 8);
    return eight == 0x0303030303030303u;
}

GS4I_INLINE int gs4i_is_deep(const uint8_t *v, ptrdiff_t ny, ptrdiff_t nz)
{
    const uint8_t *const around[7] = { v, v - 1, v + 1, v - ny, v + ny, v - nz, v + nz };
    uint64_t all = ~(uint64_t)0, eight;
    int a;
    for (a = 0; a < 7; a++) {
        memcpy(&eight, around[a], 8);
        all &= eight;
    }
    return all == 0x0303030303030303u;
}

/* A strip of both colours, in the order of its cells. */
enum {
    GS4I_BOTH = 2 * GS4I_STRIP
};
typedef struct gs4i_built {
    double w[6][GS4I_BOTH], given[GS4I_BOTH]; /* faces, diagonal */
    float face[3][GS4I_BOTH], low[3][GS4I_BOTH], inverse[GS4I_BOTH], diagonal[GS4I_BOTH],
        diagonal_low[GS4I_BOTH];
    /* what level 1 gets: of faces towards + between liquid cells, of those to the air */
    float coarse[3][GS4I_BOTH], air[GS4I_BOTH], held[GS4I_BOTH]; /* held: air and diagonal */
    int deep; /* all faces are 1 and between liquid cells */
} gs4i_built;

/* Whether any of n cells or their neighbours towards + is liquid. */
static int gs4i_is_strip_wet(const gs4i_given_row *q, int i, int n)
{
    const uint8_t *kind = q->kind + i;
    int l, all = kind[n];
    for (l = 0; l < n; l++) all |= kind[l] | kind[l + q->beside[3]] | kind[l + q->beside[5]];
    return all & GS4I_IS_LIQUID;
}

GS4I_INLINE void gs4i_build_faces(gs4i_built *b, const gs4i_given_row *q, int i, int n, int f)
{
    const uint8_t *GS4I_RESTRICT kind = q->kind + i, *GS4I_RESTRICT other = kind + q->beside[f];
    const gs4_real *GS4I_RESTRICT face = q->face[f] ? q->face[f] + i : NULL;
    double *GS4I_RESTRICT w = b->w[f];
    float *GS4I_RESTRICT coarse = b->coarse[f >> 1], *GS4I_RESTRICT air = b->air;
    int l, any = 0; /* of these cells beside air */
    if (face)
        for (l = 0; l < n; l++)
            w[l] = kind[l] & other[l] & (kind[l] | other[l]) >> 1 ? (double)face[l] * q->unit : 0;
    else
        for (l = 0; l < n; l++) w[l] = (kind[l] & other[l] & (kind[l] | other[l]) >> 1) * q->unit;
    for (l = 0; l < n; l++) any |= kind[l] & ~other[l] & other[l] << 1;
    for (l = 0; l < n && any; l++)
        air[l] += (float)(0.75 * w[l]) * (float)((kind[l] & ~other[l]) >> 1);
    if (!(f & 1)) return;
    for (l = 0; l < n; l++) coarse[l] = (float)(0.5 * w[l]) * (float)((kind[l] & other[l]) >> 1);
    for (l = 0; l < n && f == 1; l += 2) coarse[l] = 0; /* within a cell of level 1 */
}

/* Where all faces are 1, `diagonal` has the faces that do not conduct as well: -1 for each. */
GS4I_INLINE void gs4i_build_cells(gs4i_built *GS4I_RESTRICT b, const gs4i_given_row *q, int i,
                                  int n)
{
    const uint8_t *GS4I_RESTRICT kind = q->kind + i;
    int l, f;
    for (l = 0; l < n; l++)
        b->given[l] = q->diagonal && kind[l] & GS4I_IS_LIQUID
                          ? (double)q->diagonal[i + l] * q->diagonal_unit
                          : 0;
    for (l = 0; l < n; l++) {
        const double faces = ((b->w[0][l] + b->w[1][l]) + (b->w[2][l] + b->w[3][l]))
                             + (b->w[4][l] + b->w[5][l]),
                     center = b->given[l] + faces,
                     diagonal = b->given[l] + (q->uniform ? faces - 6 : 0);
        const double unknown = (double)(kind[l] / GS4I_IS_LIQUID) * (center > 0 ? 1.0 : 0.0);
        b->held[l] = b->air[l] + (float)b->given[l];
        b->inverse[l] = (float)(unknown / (center + (1 - unknown)));
        b->diagonal[l] = (float)(unknown * diagonal + (double)GS4I_NO_UNKNOWN * (1 - unknown));
        b->diagonal_low[l] = (float)(unknown * (diagonal - (double)(float)diagonal));
    }
    for (f = 0; f < 3 && !q->uniform; f++)
        for (l = 0; l < n; l++) {
            b->face[f][l] = (float)b->w[2 * f + 1][l];
            b->low[f][l] = (float)(b->w[2 * f + 1][l] - (double)b->face[f][l]);
        }
}

/* Cells i to i + n of a row. Nothing changes from one strip to the next where all of both, and all
 * around them, is liquid: `deep`. */
GS4I_INLINE void gs4i_build_strip(gs4i_built *b, const gs4i_given_row *q, int i, int n)
{
    int f, l, deep = q->uniform && n == GS4I_BOTH;
    for (l = 0; l < GS4I_BOTH && deep; l += 8)
        deep = gs4i_is_deep(q->kind + i + l, q->beside[3], q->beside[5]);
    if (!(deep && b->deep)) {
        memset(b->air, 0, sizeof b->air);
        for (f = 0; f < 6; f++) gs4i_build_faces(b, q, i, n, f);
    }
    if (!(deep && b->deep && !q->diagonal)) gs4i_build_cells(b, q, i, n);
    b->deep = deep;
}

/* n cells of a row, the first an even one, to two colours. */
static void gs4i_split_colours(float *GS4I_RESTRICT even, float *GS4I_RESTRICT odd,
                               const float *GS4I_RESTRICT from, int n)
{
    int m;
    for (m = 0; m < n / 2; m++) {
        even[m] = from[2 * m];
        odd[m] = from[2 * m + 1];
    }
    if (n & 1) even[m] = from[2 * m];
}

/* Adds the first two of every four cells of a strip to the cells of level 1 above it. */
static void gs4i_add_pairs(float *GS4I_RESTRICT to, const float *GS4I_RESTRICT from)
{
    int m;
    for (m = 0; m < GS4I_BOTH / 4; m++) to[m] = (to[m] + from[4 * m]) + from[4 * m + 1];
}

/* What a strip of level 0 from cell `place` on adds to level 1: zeros behind the end of the row.
 * h->z has the faces to the air alone, while setting up. */
static void gs4i_add_to_level_1(const gs4i_level *h, const gs4i_built *b, const int place[3])
{
    const int i = place[0], j = place[1], k = place[2];
    const size_t row = gs4i_row_of(h, j / 2, k / 2) + (size_t)(i / 4);
    int l;
    for (l = 0; l < 4; l += 2) {
        const int up = ((i + l) / 2 + j / 2 + k / 2) & 1;
        gs4i_add_pairs(h->w[0][up] + row, b->coarse[0] + l);
        if (j & 1) gs4i_add_pairs(h->w[1][up] + row, b->coarse[1] + l);
        if (k & 1) gs4i_add_pairs(h->w[2][up] + row, b->coarse[2] + l);
        gs4i_add_pairs(h->diagonal[up] + row, b->held + l);
        gs4i_add_pairs(h->z[up] + row, b->air + l);
    }
}

/* A row of level 0, and what its cells add to level 1. */
static void gs4i_build_row(gs4i_solver *s, const gs4_poisson_desc *d, int j, int k)
{
    const gs4i_level *g = &s->level[0];
    const size_t row = gs4i_row_of(g, j, k);
    const int c = (j + k) & 1;
    int place[3] = { 0, j, k }, n, f, l;
    gs4i_given_row q;
    gs4i_built b;
    size_t m;
    b.deep = 0;
    gs4i_find_row(&q, s, d, j, k);
    for (f = 0; f < 2; f++)
        for (m = row; m < row + g->stride; m++) g->diagonal[f][m] = GS4I_NO_UNKNOWN;
    for (; place[0] < g->n[0]; place[0] += GS4I_BOTH) {
        const size_t at = row + (size_t)(place[0] / 2);
        n = g->n[0] - place[0] < GS4I_BOTH ? g->n[0] - place[0] : GS4I_BOTH;
        if (gs4i_is_strip_wet(&q, place[0], n)) {
            if (n == GS4I_BOTH) { /* a constant: loops in vectors */
                gs4i_build_strip(&b, &q, place[0], GS4I_BOTH);
            } else {
                memset(&b, 0, sizeof b);
                gs4i_build_strip(&b, &q, place[0], n);
            }
            gs4i_add_to_level_1(&s->level[1], &b, place);
        } else {
            memset(&b, 0, sizeof b);
            for (l = 0; l < n; l++) b.diagonal[l] = GS4I_NO_UNKNOWN;
        }
        gs4i_split_colours(g->inverse[c] + at, g->inverse[!c] + at, b.inverse, n);
        gs4i_split_colours(g->diagonal[c] + at, g->diagonal[!c] + at, b.diagonal, n);
        if (g->diagonal_low[0])
            gs4i_split_colours(g->diagonal_low[c] + at, g->diagonal_low[!c] + at, b.diagonal_low,
                               n);
        for (f = 0; f < 3 && g->w[0][0]; f++) {
            gs4i_split_colours(g->w[f][c] + at, g->w[f][!c] + at, b.face[f], n);
            if (g->w_low[f][0])
                gs4i_split_colours(g->w_low[f][c] + at, g->w_low[f][!c] + at, b.low[f], n);
        }
    }
}

/* First and last strip of a row with liquid. */
static void gs4i_build_span(const gs4i_solver *s, int j, int k, int32_t span[2])
{
    const uint8_t *kind = gs4i_kinds_of(s, j, k);
    int first = 0, last = s->level[0].n[0] - 1;
    while (first <= last && !(kind[first] & GS4I_IS_LIQUID)) first++;
    while (last >= first && !(kind[last] & GS4I_IS_LIQUID)) last--;
    span[0] = first > last ? 0 : first / 2 / GS4I_STRIP * GS4I_STRIP;
    span[1] = first > last ? 0 : (last / 2 / GS4I_STRIP + 1) * GS4I_STRIP;
}

/* A plane of level 1 and the two below it. */
static void gs4i_build_planes(int bk, void *context)
{
    const gs4i_setup *u = (const gs4i_setup *)context;
    gs4i_solver *s = u->s;
    const gs4i_level *g = &s->level[0], *h = &s->level[1];
    int32_t first, last;
    int j, k;
    for (j = 0; j < h->n[1]; j++) {
        h->span[2 * (bk * h->n[1] + j)] = INT32_MAX;
        h->span[2 * (bk * h->n[1] + j) + 1] = 0;
    }
    for (k = 2 * bk; k < 2 * bk + 2 && k < g->n[2]; k++)
        for (j = 0; j < g->n[1]; j++) {
            int32_t *span = g->span + 2 * ((size_t)k * (size_t)g->n[1] + (size_t)j);
            int32_t *wide = h->span + 2 * ((size_t)bk * (size_t)h->n[1] + (size_t)(j / 2));
            gs4i_build_span(s, j, k, span);
            gs4i_build_row(s, u->d, j, k);
            if (span[0] >= span[1]) continue;
            first = span[0] / 2 / GS4I_STRIP * GS4I_STRIP;
            last = (span[1] / 2 + GS4I_STRIP - 1) / GS4I_STRIP * GS4I_STRIP;
            if (first < wide[0]) wide[0] = first;
            if (last > wide[1]) wide[1] = last;
        }
    for (j = 0; j < h->n[1]; j++)
        if (!h->span[2 * (bk * h->n[1] + j) + 1]) h->span[2 * (bk * h->n[1] + j)] = 0;
}

/* Sum of the faces of a cell of level 1. */
static float gs4i_faces(const gs4i_level *g, int c, size_t at, int t)
{
    return ((g->w[0][!c][at + (size_t)t - 1] + g->w[0][c][at])
            + (g->w[1][!c][at - g->stride] + g->w[1][c][at]))
           + (g->w[2][!c][at - g->plane] + g->w[2][c][at]);
}

static void gs4i_build_inverse(int k, void *context)
{
    const gs4i_level *g = &((const gs4i_setup *)context)->s->level[1];
    int j, c, m;
    for (j = 0; j < g->n[1]; j++)
        for (c = 0; c < 2; c++) {
            const size_t row = gs4i_row_of(g, j, k);
            const int t = (c + j + k) & 1;
            for (m = 0; m < g->width; m++) {
                const float sum =
                    g->diagonal[c][row + (size_t)m] + gs4i_faces(g, c, row + (size_t)m, t);
                g->inverse[c][row + (size_t)m] = sum > 0 ? 1 / sum : 0;
            }
        }
}

/* Slabs of equal work for the tasks of a wavefront, at even planes and at least 16 thick. */
static void gs4i_cut_slabs(gs4i_solver *s, int level, int slabs)
{
    const gs4i_level *g = &s->level[level];
    const size_t rows = (size_t)g->n[1];
    double all = 0, done = 0;
    size_t j;
    int k, count = 1;
    for (j = 0; j < rows * (size_t)g->n[2]; j++) all += g->span[2 * j + 1] - g->span[2 * j] + 1;
    if (all < 16384) slabs = 1;
    s->cut[level][0] = 0;
    for (k = 0; k < g->n[2]; k++) {
        const int thick = k - s->cut[level][count - 1] >= 16 && g->n[2] - k >= 16;
        if (count < slabs && thick && !(k & 1) && done >= all * count / slabs)
            s->cut[level][count++] = k;
        for (j = (size_t)k * rows; j < (size_t)(k + 1) * rows; j++)
            done += g->span[2 * j + 1] - g->span[2 * j] + 1;
    }
    s->cut[level][count] = g->n[2];
    s->slabs[level] = count;
}

/* --- setup: connected groups ------------------------------------------------------------------ */

/* Colours and places of the eight cells of level 1 in a block; number x + 2 y + 4 z. */
GS4I_INLINE int gs4i_child_colour(int q) { return (q ^ (q >> 1) ^ (q >> 2)) & 1; }
GS4I_INLINE size_t gs4i_child(const gs4i_level *g, size_t block, int q)
{
    return block + (size_t)(q >> 1 & 1) * g->stride + (size_t)(q >> 2) * g->plane;
}
GS4I_INLINE size_t gs4i_block_of(const gs4i_level *g, int bi, int bj, int bk)
{
    return gs4i_row_of(g, 2 * bj, 2 * bk) + (size_t)bi;
}

static float gs4i_largest_weight(const gs4i_level *g, int c, size_t at, int t)
{
    const float w[6] = { g->w[0][!c][at + (size_t)t - 1], g->w[0][c][at],
                         g->w[1][!c][at - g->stride],     g->w[1][c][at],
                         g->w[2][!c][at - g->plane],      g->w[2][c][at] };
    float most = 0;
    int f;
    for (f = 0; f < 6; f++)
        if (w[f] > most) most = w[f];
    return most;
}

/* Whether a face or an edge w joins its ends: not if both have much stronger ones. So the two sides
 * of a door stay two unknowns, and so do a room and the part of the next one in its block. */
GS4I_INLINE int gs4i_is_strong(float w, float most, float other, float strong)
{
    return w > 0 && w * w >= strong * strong * most * other;
}

/* Groups of a block: of each cell the first cell of its group, -1 without edges. */
static void gs4i_group_block(const gs4i_level *g, size_t block, int group[8])
{
    int q, a, i;
    float most[8];
    for (q = 0; q < 8; q++) {
        most[q] = gs4i_largest_weight(g, gs4i_child_colour(q), gs4i_child(g, block, q), q & 1);
        group[q] = most[q] > 0 ? q : -1;
    }
    for (q = 0; q < 8; q++)
        for (a = 0; a < 3; a++) {
            const int other = q | 1 << a;
            int from, into;
            if (other == q
                || !gs4i_is_strong(g->w[a][gs4i_child_colour(q)][gs4i_child(g, block, q)], most[q],
                                   most[other], GS4I_STRONG))
                continue;
            from = group[q] > group[other] ? group[q] : group[other];
            into = group[q] + group[other] - from;
            for (i = 0; i < 8; i++)
                if (group[i] == from) group[i] = into;
        }
}

static void gs4i_number_groups(int bk, void *context)
{
    const gs4i_setup *u = (const gs4i_setup *)context;
    gs4i_solver *s = u->s;
    const gs4i_level *g = &s->level[1];
    int32_t *count = u->counts + 2 * bk, number[8];
    int group[8], bi, bj, q;
    count[0] = count[1] = 0;
    /* no parent behind the end of a row either */
    for (bj = 2 * bk * g->n[1]; bj < 2 * (bk + 1) * g->n[1] && bj < g->n[1] * g->n[2]; bj++)
        memset(s->parent[0] + gs4i_row_of(g, bj % g->n[1], bj / g->n[1]), 0xff,
               g->stride * sizeof(int32_t));
    for (bj = 0; bj < (g->n[1] + 1) / 2; bj++)
        for (bi = 0; bi < (g->n[0] + 1) / 2; bi++) {
            const size_t block = gs4i_block_of(g, bi, bj, bk);
            gs4i_group_block(g, block, group);
            for (q = 0; q < 8; q++) {
                if (group[q] == q) number[q] = count[(bi + bj + bk) & 1]++;
                if (2 * bj + (q >> 1 & 1) < g->n[1] && 2 * bk + (q >> 2) < g->n[2])
                    s->parent[gs4i_child_colour(q)][gs4i_child(g, block, q)] =
                        group[q] < 0 ? -1 : number[group[q]];
            }
        }
}

/* A face in series with the resistances on either side, at least `least` of the face. */
GS4I_INLINE float gs4i_conductance(float w, float before, float after, float least)
{
    const float series = 1 / (1 / w + before + after);
    return series > least * w ? series : least * w;
}

/* What a face w adds to the edge between two groups: w in series with half of `inner`, the face
 * that its cell has along the same axis within its group. That is the conductance from centre to
 * centre: w / 2 in the interior, more of it behind a wall of one layer, all of it at a door.
 * With w / 2 everywhere T3 of 132^3 cells takes 42 iterations, not 15. 0.35: chosen. */
GS4I_INLINE float gs4i_series(float w, float inner, float other)
{
    if (inner == w && other == w) return 0.5f * w; /* the interior, without a division */
    return gs4i_conductance(w, inner > 0 ? 0.5f / inner : 0, other > 0 ? 0.5f / other : 0, 0.35f);
}

/* The same for two groups in one block, which have no axis. The end of a chain of n nodes is
 * (n - 1) / 2 edges from its middle, a heap is nearer; 0.15 is between (0.12 to 0.18 are alike).
 * With w itself T4 of 132^3 cells takes 26 iterations, not 19. 0.1: chosen. */
GS4I_INLINE float gs4i_chain(float w, float inner, int n, float other, int other_n)
{
    return gs4i_conductance(w, n > 1 ? 0.15f * (float)(n - 1) / inner : 0,
                            other_n > 1 ? 0.15f * (float)(other_n - 1) / other : 0, 0.1f);
}

/* What a face to the air is on the next level: 3/4 at a surface, measured best. More where it is
 * small beside the cell's other faces, as a bubble of one cell is on coarse levels. */
GS4I_INLINE float gs4i_air(float air, float face)
{
    const float part = air > 0 ? face / (face + 0.5f * air) : 0;
    return (part > 0.75f ? part : 0.75f) * air;
}

/* Turns numbers within planes into numbers of the graph, and sums up what nodes are made of. */
static void gs4i_fill_groups(int bk, void *context)
{
    const gs4i_setup *u = (const gs4i_setup *)context;
    gs4i_solver *s = u->s;
    const gs4i_level *g = &s->level[1];
    gs4i_graph *up = &s->graph[0];
    int bi, bj, q;
    for (bj = 0; bj < (g->n[1] + 1) / 2; bj++)
        for (bi = 0; bi < (g->n[0] + 1) / 2; bi++)
            for (q = 0; q < 8; q++) {
                const size_t block = gs4i_block_of(g, bi, bj, bk);
                const int c = gs4i_child_colour(q);
                const size_t at = gs4i_child(g, block, q);
                int32_t *parent = &s->parent[c][at];
                float diagonal;
                if (2 * bj + (q >> 1 & 1) >= g->n[1] || 2 * bk + (q >> 2) >= g->n[2] || *parent < 0)
                    continue;
                *parent += u->counts[2 * bk + ((bi + bj + bk) & 1)];
                diagonal = g->diagonal[c][at] - g->z[c][at];
                if (g->z[c][at] > 0)
                    up->air[*parent] += gs4i_air(g->z[c][at], gs4i_largest_weight(g, c, at, q & 1));
                up->diagonal[*parent] += diagonal > 0 ? diagonal : 0;
                up->block[*parent] = (uint64_t)bi | (uint64_t)bj << 21 | (uint64_t)bk << 42;
            }
}

typedef struct gs4i_edge {
    int32_t from, to;
    float w;
} gs4i_edge;

/* Face of cell `bits` of a block along axis a, within the block. */
GS4I_INLINE float gs4i_inner_face(const gs4i_level *g, int c, size_t at, int bits, int a)
{
    return !(bits >> a & 1) ? g->w[a][c][at]
                            : g->w[a][!c][a == 0 ? at : at - (a == 1 ? g->stride : g->plane)];
}

/* Edges from the groups of a block to groups around, each once; with w if `weigh`. */
GS4I_INLINE int gs4i_block_edges(const gs4i_solver *s, int bi, int bj, int bk, gs4i_edge *edge,
                                 int weigh)
{
    const gs4i_level *g = &s->level[1];
    const size_t block = gs4i_block_of(g, bi, bj, bk);
    int q, f, e, count = 0;
    for (q = 0; q < 8; q++) {
        const int c = gs4i_child_colour(q);
        const size_t at = gs4i_child(g, block, q);
        int32_t from;
        if (2 * bj + (q >> 1 & 1) >= g->n[1] || 2 * bk + (q >> 2) >= g->n[2]) continue;
        from = s->parent[c][at];
        if (from < 0) continue;
        for (f = 0; f < 6; f++) {
            const int a = f >> 1, high = f & 1, x = q & 1;
            const size_t step = a == 1 ? g->stride : g->plane,
                         beside = a      ? (high ? at + step : at - step)
                                  : high ? at + (size_t)x
                                         : at + (size_t)x - 1;
            const int32_t to = s->parent[!c][beside];
            const float w = high ? g->w[a][c][at] : g->w[a][!c][beside];
            if (to == from || !(w > 0)) continue;
            for (e = count - 1; e >= 0 && !(edge[e].from == from && edge[e].to == to); e--) {
            }
            if (e < 0) {
                e = count++;
                edge[e].from = from;
                edge[e].to = to;
                edge[e].w = 0;
            }
            if (!weigh) continue;
            if ((q >> a & 1) != high)
                edge[e].w += w; /* a weak face within the block */
            else
                edge[e].w += gs4i_series(w, gs4i_inner_face(g, c, at, q, a),
                                         gs4i_inner_face(g, !c, beside, q ^ 1 << a, a));
        }
    }
    return count;
}

static void gs4i_count_edges(int bk, void *context)
{
    const gs4i_setup *u = (const gs4i_setup *)context;
    const gs4i_level *g = &u->s->level[1];
    gs4i_edge edge[48];
    int bi, bj, e;
    for (bj = 0; bj < (g->n[1] + 1) / 2; bj++)
        for (bi = 0; bi < (g->n[0] + 1) / 2; bi++)
            for (e = gs4i_block_edges(u->s, bi, bj, bk, edge, 0) - 1; e >= 0; e--)
                u->s->graph[0].start[edge[e].from + 1]++;
}

static void gs4i_fill_edges(int bk, void *context)
{
    const gs4i_setup *u = (const gs4i_setup *)context;
    const gs4i_level *g = &u->s->level[1];
    gs4i_graph *up = &u->s->graph[0];
    gs4i_edge edge[48];
    int bi, bj, e, f, count;
    for (bj = 0; bj < (g->n[1] + 1) / 2; bj++)
        for (bi = 0; bi < (g->n[0] + 1) / 2; bi++) {
            count = gs4i_block_edges(u->s, bi, bj, bk, edge, 1);
            for (e = 0; e < count; e++) {
                int32_t place = up->start[edge[e].from];
                for (f = 0; f < e; f++) place += edge[f].from == edge[e].from;
                up->to[place] = edge[e].to;
                up->w[place] = edge[e].w;
            }
        }
}

static int gs4i_reserve_nodes(gs4i_solver *s, gs4i_graph *g, int n, int reds)
{
    char *base = NULL;
    size_t used;
    int laid;
    g->n = n;
    g->reds = reds;
    g->mixed = 0;
    for (laid = 0; laid < 2; laid++) {
        float **const numbers[6] = { &g->inverse, &g->center, &g->air, &g->diagonal, &g->b, &g->x };
        int i;
        used = 0;
        for (i = 0; i < 6; i++)
            *numbers[i] = (float *)gs4i_carve(base, &used, (size_t)n, sizeof(float));
        g->start = (int32_t *)gs4i_carve(base, &used, (size_t)n + 1, sizeof(int32_t));
        g->parent = (int32_t *)gs4i_carve(base, &used, (size_t)n, sizeof(int32_t));
        g->block = (uint64_t *)gs4i_carve(base, &used, (size_t)n, sizeof(uint64_t));
        if (!laid && gs4i_reserve(s, &g->nodes, used, 1) != GS4_OK) return GS4_ERROR_MEMORY;
        base = (char *)g->nodes.data;
    }
    return GS4_OK;
}

/* From the number of edges of node i in start[i + 1]. */
static int gs4i_reserve_edges(gs4i_solver *s, gs4i_graph *g)
{
    size_t count, used = 0;
    int i;
    for (i = 0; i < g->n; i++) g->start[i + 1] += g->start[i];
    count = (size_t)g->start[g->n];
    if (gs4i_reserve(s, &g->edges, 2 * count * sizeof(float) + 128, 0) != GS4_OK)
        return GS4_ERROR_MEMORY;
    g->to = (int32_t *)gs4i_carve((char *)g->edges.data, &used, count, sizeof(int32_t));
    g->w = (float *)gs4i_carve((char *)g->edges.data, &used, count, sizeof(float));
    return GS4_OK;
}

static void gs4i_finish_graph(gs4i_graph *g)
{
    int i, e;
    for (i = 0; i < g->n; i++) {
        float sum = g->air[i] + g->diagonal[i];
        for (e = g->start[i]; e < g->start[i + 1]; e++) {
            sum += g->w[e];
            g->mixed |= (i < g->reds) == (g->to[e] < g->reds);
        }
        g->center[i] = sum;
        g->inverse[i] = sum > 0 ? 1 / sum : 0;
    }
}

/* Graph 0 from level 1. */
static int gs4i_build_groups(gs4i_setup *u)
{
    gs4i_solver *s = u->s;
    const int planes = (s->level[1].n[2] + 1) / 2;
    int32_t reds = 0, nodes = 0, count;
    int k, c;
    gs4i_parallel_for(s->tasks, planes, gs4i_number_groups, u);
    for (c = 0; c < 2; c++) {
        for (k = 0; k < planes; k++) {
            count = u->counts[2 * k + c];
            u->counts[2 * k + c] = nodes;
            nodes += count;
        }
        if (c == 0) reds = nodes;
    }
    if (gs4i_reserve_nodes(s, &s->graph[0], nodes, reds) != GS4_OK) return GS4_ERROR_MEMORY;
    gs4i_parallel_for(s->tasks, planes, gs4i_fill_groups, u);
    gs4i_parallel_for(s->tasks, planes, gs4i_count_edges, u);
    if (gs4i_reserve_edges(s, &s->graph[0]) != GS4_OK) return GS4_ERROR_MEMORY;
    gs4i_parallel_for(s->tasks, planes, gs4i_fill_edges, u);
    gs4i_finish_graph(&s->graph[0]);
    s->graphs = 1;
    for (c = 0; c < 2; c++) gs4i_clear(s, s->level[1].z[c], s->level[1].count * sizeof(float));
    return GS4_OK;
}

#define GS4I_LOWEST_BITS ((uint64_t)1 | (uint64_t)1 << 21 | (uint64_t)1 << 42)

/* Joins nodes of a graph by edges within a block of the next one, strong edges first, to groups of
 * at most `most`. g->parent becomes the number in the next graph. */
static void gs4i_join_nodes(gs4i_graph *g, float strong, int most, int32_t *number, int *reds,
                            int *blacks)
{
    int32_t *root = g->parent;
    int i, e, round;
    *reds = *blacks = 0;
    /* x: the strongest edge, while setting up */
    for (i = 0; i < g->n; i++) {
        g->x[i] = 0;
        for (e = g->start[i]; e < g->start[i + 1]; e++)
            if (g->w[e] > g->x[i]) g->x[i] = g->w[e];
    }
    for (i = 0; i < g->n; i++) {
        root[i] = g->start[i] < g->start[i + 1] ? i : -1;
        number[i] = 1;
    }
    for (round = 2; round > 0; round--)
        for (i = 0; i < g->n; i++)
            for (e = g->start[i]; e < g->start[i + 1]; e++) {
                int32_t a = i, b = g->to[e];
                if ((g->block[a] ^ g->block[b]) & ~GS4I_LOWEST_BITS
                    || !gs4i_is_strong(g->w[e], g->x[a], g->x[b], (float)round * strong))
                    continue;
                while (root[a] != a) a = root[a] = root[root[a]];
                while (root[b] != b) b = root[b] = root[root[b]];
                if (a == b || number[a] + number[b] > most) continue;
                if (a > b) {
                    const int32_t m = a;
                    a = b;
                    b = m;
                }
                root[b] = a;
                number[a] += number[b];
            }
    for (i = 0; i < g->n; i++) {
        const uint64_t block = g->block[i] >> 1;
        if (root[i] < 0) continue;
        if (root[i] == i)
            number[i] = (block ^ block >> 21 ^ block >> 42) & 1 ? -1 - (*blacks)++ : (*reds)++;
        else
            root[i] = root[root[i]]; /* a root is before all that it holds */
    }
    for (i = 0; i < g->n; i++)
        if (root[i] >= 0) {
            const int32_t m = number[root[i]];
            root[i] = m < 0 ? *reds - 1 - m : m;
        }
}

/* Axis along which the blocks of two joined nodes are neighbours. */
GS4I_INLINE int gs4i_axis(uint64_t a, uint64_t b)
{
    return (a ^ b) >> 42 ? 2 : (a ^ b) >> 21 ? 1 : 0;
}

/* Edges of each node within its group: their sum along each axis, and of all. */
static void gs4i_sum_inner_edges(const gs4i_graph *g, float (*inner)[4])
{
    int i, e;
    memset(inner, 0, (size_t)g->n * sizeof *inner);
    for (i = 0; i < g->n; i++)
        for (e = g->start[i]; e < g->start[i + 1]; e++) {
            if (g->parent[g->to[e]] != g->parent[i]) continue;
            if (g->block[g->to[e]] != g->block[i])
                inner[i][gs4i_axis(g->block[i], g->block[g->to[e]])] += g->w[e];
            inner[i][3] += g->w[e];
        }
}

/* Tables for the next graph: the nodes of its node i are child[first[i]] to child[first[i + 1]];
 * `place` of its edges; `inner` of each node of the last graph, see gs4i_sum_inner_edges. They
 * are in x, which is larger: 28 bytes a node, at most a node for eight cells. */
typedef struct gs4i_tables {
    int32_t *first, *child, *place;
    float (*inner)[4];
} gs4i_tables;

/* Groups of at most 8 nodes, as a block has in the interior; weaker edges join, and groups grow,
 * until a fifth of the nodes is gone. Graphs beyond the twelfth join all of a block, so that there
 * is a last one. */
static void gs4i_choose_groups(gs4i_graph *g, int all, int32_t *number, int *reds, int *blacks)
{
    float strong = all ? 0 : GS4I_STRONG;
    int most = all ? g->n : 8;
    for (;;) {
        gs4i_join_nodes(g, strong, most, number, reds, blacks);
        if (5 * (int64_t)(*reds + *blacks) <= 4 * (int64_t)g->n || strong < 1e-3f) break;
        strong *= 0.25f;
        most = most < g->n / 4 ? 4 * most : g->n;
    }
}

/* What nodes of the next graph have of those of the last, and which these are. */
static void gs4i_fill_nodes(const gs4i_graph *g, gs4i_graph *up, const gs4i_tables *t)
{
    int32_t *first = t->first;
    int i;
    memset(first, 0, ((size_t)up->n + 2) * sizeof *first);
    for (i = 0; i < g->n; i++)
        if (g->parent[i] >= 0) {
            up->air[g->parent[i]] += gs4i_air(g->air[i], g->x[i]);
            up->diagonal[g->parent[i]] += g->diagonal[i];
            up->block[g->parent[i]] = (g->block[i] & ~GS4I_LOWEST_BITS) >> 1;
            first[g->parent[i] + 2]++;
        }
    for (i = 0; i < up->n; i++) first[i + 2] += first[i + 1];
    for (i = 0; i < g->n; i++)
        if (g->parent[i] >= 0) t->child[first[g->parent[i] + 1]++] = i;
}

/* What edge e of node i adds to that of the nodes a and b of the next graph. */
static float gs4i_coarse_weight(const gs4i_graph *g, const gs4i_tables *t, int i, int e)
{
    const int32_t j = g->to[e], a = g->parent[i], b = g->parent[j];
    if ((g->block[i] ^ g->block[j]) & ~GS4I_LOWEST_BITS) {
        const int axis = gs4i_axis(g->block[i], g->block[j]);
        return gs4i_series(g->w[e], t->inner[i][axis], t->inner[j][axis]);
    }
    return gs4i_chain(g->w[e], t->inner[i][3], t->first[a + 1] - t->first[a], t->inner[j][3],
                      t->first[b + 1] - t->first[b]);
}

/* Counts the edges of the next graph into start[i + 1], or fills them in. */
static void gs4i_coarse_edges(const gs4i_graph *g, gs4i_graph *up, const gs4i_tables *t, int fill)
{
    int32_t next = 0, *place = t->place;
    int i, j, e;
    for (i = 0; i < up->n; i++) place[i] = -1;
    for (i = 0; i < up->n; i++) {
        const int32_t begin = next;
        for (j = t->first[i]; j < t->first[i + 1]; j++)
            for (e = g->start[t->child[j]]; e < g->start[t->child[j] + 1]; e++) {
                const int32_t to = g->parent[g->to[e]];
                if (to == i) continue;
                if (place[to] < begin) {
                    place[to] = next++;
                    if (fill) {
                        up->to[place[to]] = to;
                        up->w[place[to]] = 0;
                    }
                }
                if (fill) up->w[place[to]] += gs4i_coarse_weight(g, t, t->child[j], e);
            }
        if (!fill) up->start[i + 1] = next - begin;
    }
}

/* The next graph from the last. */
static int gs4i_coarsen_graph(gs4i_solver *s)
{
    gs4i_graph *g = &s->graph[s->graphs - 1], *up = &s->graph[s->graphs];
    gs4i_tables t;
    int reds, blacks;
    t.first = (int32_t *)(void *)s->x[0];
    t.child = t.first + g->n + 2;
    t.place = t.child + g->n;
    t.inner = (float(*)[4])(void *)(t.place + g->n);
    gs4i_choose_groups(g, s->graphs > GS4I_GRAPHS / 2, t.first, &reds, &blacks);
    gs4i_sum_inner_edges(g, t.inner);
    if (gs4i_reserve_nodes(s, up, reds + blacks, reds) != GS4_OK) return GS4_ERROR_MEMORY;
    gs4i_fill_nodes(g, up, &t);
    gs4i_coarse_edges(g, up, &t, 0);
    if (gs4i_reserve_edges(s, up) != GS4_OK) return GS4_ERROR_MEMORY;
    gs4i_coarse_edges(g, up, &t, 1);
    gs4i_finish_graph(up);
    s->graphs++;
    return GS4_OK;
}

/* Cholesky factor of the last graph. A pivot below 1e-6 of a_ii, far above rounding in float,
 * belongs to a closed pocket and is skipped. */
static int gs4i_factorize(gs4i_solver *s)
{
    const gs4i_graph *g = &s->graph[s->graphs - 1];
    const size_t n = (size_t)g->n;
    double *factor;
    size_t i, j, k;
    int e;
    if (gs4i_reserve(s, &s->square, n * n * sizeof(double), 1) != GS4_OK) return GS4_ERROR_MEMORY;
    s->factor = factor = (double *)s->square.data;
    for (i = 0; i < n; i++) {
        factor[i * n + i] = (double)g->center[i];
        for (e = g->start[i]; e < g->start[i + 1]; e++)
            if ((size_t)g->to[e] < i) factor[i * n + (size_t)g->to[e]] = -(double)g->w[e];
    }
    for (i = 0; i < n; i++) {
        for (j = 0; j <= i; j++) {
            double sum = factor[i * n + j];
            for (k = 0; k < j; k++) sum -= factor[i * n + k] * factor[j * n + k];
            if (j < i)
                factor[i * n + j] = factor[j * n + j] > 0 ? sum / factor[j * n + j] : 0;
            else
                factor[i * n + i] = sum > 1e-6 * (double)g->center[i] ? sqrt(sum) : 0;
        }
    }
    return GS4_OK;
}

/* --- setup: closed pockets -------------------------------------------------------------------- */

/* Whether cells begin to end of a row have a face to the air or a diagonal. */
static int gs4i_is_regular(const gs4i_given_row *q, int uniform, int begin, int end)
{
    int i, f, regular = 0;
    for (i = begin; i < end && !regular; i++) {
        if (uniform && !q->diagonal && i + 8 <= end
            && gs4i_is_deep(q->kind + i, q->beside[3], q->beside[5])) {
            i += 7;
            continue;
        }
        for (f = 0; f < 6; f++)
            regular |=
                q->kind[i + q->beside[f]] == GS4I_IS_OPEN && (uniform || gs4i_face_of(q, i, f) > 0);
        if (q->diagonal) regular |= q->diagonal[i] > 0;
    }
    return regular;
}

/* Runs of liquid cells of a plane that faces join, from u->counts[k] on: `pocket` is the place
 * in the list, `sum` above 0 where air or diagonal make x unique. Without a list: counts them. */
static void gs4i_list_runs(int k, void *context)
{
    const gs4i_setup *u = (const gs4i_setup *)context;
    const gs4i_solver *s = u->s;
    gs4i_run *run = s->runs;
    gs4i_given_row q;
    int32_t count = run ? u->counts[k] : 0;
    const int n = s->level[0].n[0];
    int i, j, end;
    for (j = 0; j < s->level[0].n[1]; j++) {
        gs4i_find_row(&q, s, u->d, j, k);
        for (i = 0; i < n; i = end) {
            end = i + 1;
            if (!(q.kind[i] & GS4I_IS_LIQUID)) continue;
            while (q.kind[end] & GS4I_IS_LIQUID && (s->uniform || gs4i_face_of(&q, end, 0) > 0))
                end += s->uniform && end + 8 <= n && gs4i_is_wet(q.kind + end) ? 8 : 1;
            if (run) {
                run[count].row = k * s->level[0].n[1] + j;
                run[count].begin = i;
                run[count].end = end;
                run[count].pocket = count;
                run[count].sum = gs4i_is_regular(&q, s->uniform, i, end);
            }
            count++;
        }
    }
    if (!run) u->counts[k] = count;
}

static int32_t gs4i_root(gs4i_run *run, int32_t a)
{
    while (run[a].pocket != a) a = run[a].pocket = run[run[a].pocket].pocket;
    return a;
}

/* Joins run a with those of row `row`, a neighbour along axis f / 2. *b: the first run that may
 * touch it, which only moves on. */
static void gs4i_join_runs(gs4i_setup *u, gs4i_run *run, int32_t a, int32_t *b, int row, int f)
{
    const int ny = u->s->level[0].n[1];
    gs4i_given_row q;
    int32_t o;
    int i;
    while (*b < a && (run[*b].row < row || (run[*b].row == row && run[*b].end <= run[a].begin)))
        (*b)++;
    gs4i_find_row(&q, u->s, u->d, run[a].row % ny, run[a].row / ny);
    for (o = *b; o < a && run[o].row == row && run[o].begin < run[a].end; o++) {
        const int begin = run[o].begin > run[a].begin ? run[o].begin : run[a].begin,
                  end = run[o].end < run[a].end ? run[o].end : run[a].end;
        for (i = begin; i < end && !(gs4i_face_of(&q, i, f) > 0); i++) {
        }
        if (i < end) {
            const int32_t r = gs4i_root(run, a), t = gs4i_root(run, o), low = r < t ? r : t,
                          high = r < t ? t : r;
            run[high].pocket = low;
            if (run[high].sum > 0) run[low].sum = 1;
        }
    }
}

/* Closed pockets: connected liquid with neither air nor diagonal. There x is unique but for its
 * mean, and the mean of the right-hand side must vanish. */
static int gs4i_find_pockets(gs4i_setup *u)
{
    gs4i_solver *s = u->s;
    const int ny = s->level[0].n[1], nz = s->level[0].n[2];
    int64_t all = 0;
    int32_t a, y = 0, z = 0, count, kept = 0;
    gs4i_run *run;
    int k;
    s->runs = NULL;
    gs4i_parallel_for(s->tasks, nz, gs4i_list_runs, u);
    for (k = 0; k < nz; k++) {
        const int32_t here = u->counts[k];
        u->counts[k] = (int32_t)all;
        all += here;
    }
    if (all > INT32_MAX || gs4i_reserve(s, &s->cells, (size_t)all * sizeof *run, 0) != GS4_OK)
        return GS4_ERROR_MEMORY;
    count = (int32_t)all;
    s->runs = run = (gs4i_run *)s->cells.data;
    gs4i_parallel_for(s->tasks, nz, gs4i_list_runs, u);
    for (a = 0; a < count; a++) {
        if (run[a].row % ny) gs4i_join_runs(u, run, a, &y, run[a].row - 1, 2);
        if (run[a].row >= ny) gs4i_join_runs(u, run, a, &z, run[a].row - ny, 4);
    }
    /* a root comes before all of its runs; sum: 1 regular, -1 - p in pocket p */
    for (s->pockets = 0, a = 0; a < count; a++) {
        run[a].pocket = gs4i_root(run, a);
        if (run[a].pocket != a)
            run[a].sum = run[run[a].pocket].sum;
        else if (!(run[a].sum > 0))
            run[a].sum = -1 - s->pockets++;
    }
    if (gs4i_reserve(s, &s->labels, 2 * (size_t)s->pockets * sizeof(double), 1) != GS4_OK)
        return GS4_ERROR_MEMORY;
    s->pocket = (double *)s->labels.data;
    for (a = 0; a < count; a++)
        if (run[a].sum < 0) {
            run[kept] = run[a];
            run[kept].pocket = (int32_t)(-1 - run[a].sum);
            s->pocket[2 * run[kept].pocket + 1] += run[kept].end - run[kept].begin;
            kept++;
        }
    s->run_count = kept;
    return GS4_OK;
}

/* Everything that depends on the matrix. The solver keeps nothing of `d`, and its memory from
 * setup to setup. */
static int gs4i_solver_setup(gs4i_solver *s, const gs4_poisson_desc *d)
{
    const int slabs = d->threads > 1 ? 2 * d->threads : d->parallel_for ? 8 : 1;
    gs4i_setup u;
    int l;
    memset(&u, 0, sizeof u);
    u.s = s;
    u.d = d;
    s->graphs = 0;
    s->fault = NULL;
    if (gs4i_read_problem(&u) != GS4_OK) return s->fault ? GS4_ERROR_ARGUMENT : GS4_ERROR_MEMORY;
    gs4i_parallel_for(s->tasks, s->level[1].n[2], gs4i_build_planes, &u);
    gs4i_parallel_for(s->tasks, s->level[1].n[2], gs4i_build_inverse, &u);
    for (l = 0; l < 2; l++) gs4i_cut_slabs(s, l, slabs > GS4I_SLABS ? GS4I_SLABS : slabs);
    if (gs4i_build_groups(&u) != GS4_OK) return GS4_ERROR_MEMORY;
    while (s->graph[s->graphs - 1].n > GS4I_DENSE)
        if (gs4i_coarsen_graph(s) != GS4_OK) return GS4_ERROR_MEMORY;
    gs4i_clear(s, s->x[0], s->level[0].count * sizeof(double));
    if (gs4i_factorize(s) != GS4_OK) return GS4_ERROR_MEMORY;
    return gs4i_find_pockets(&u);
}

static void gs4i_solver_free(gs4i_solver *s)
{
    gs4i_scratch *const parts[6] = { &s->grid,  &s->kinds,  &s->planes,
                                     &s->cells, &s->labels, &s->square };
    int i;
    for (i = 0; i < 6; i++) gs4i_release(s->memory, parts[i]);
    for (i = 0; i < GS4I_GRAPHS; i++) {
        gs4i_release(s->memory, &s->graph[i].nodes);
        gs4i_release(s->memory, &s->graph[i].edges);
    }
}

/* --- solving ---------------------------------------------------------------------------------- */

/* What a solve starts from: 0, the guess in x, the last iterate. */
enum {
    GS4I_FROM_ZERO,
    GS4I_FROM_GUESS,
    GS4I_FROM_ITERATE
};

typedef struct gs4i_given {
    gs4i_solver *s;
    const gs4_real *rhs;
    gs4_real *x;
    int from, air; /* GS4I_FROM_ZERO ...; whether any x of the air is not 0 */
} gs4i_given;

/* Largest |rhs| in liquid, |x| in air and |x| in liquid, as bits, see gs4i_range_of_bits. */
static void gs4i_largest_bits(const gs4_real *GS4I_RESTRICT rhs, const gs4_real *GS4I_RESTRICT x,
                              const uint8_t *GS4I_RESTRICT kind, int n,
                              gs4i_bits *GS4I_RESTRICT most)
{
    gs4i_bits of_rhs = most[0], of_air = most[1], of_x = most[2];
    int i;
    for (i = 0; i < n; i++) {
        const gs4i_bits liquid = (gs4i_bits)0 - (gs4i_bits)(kind[i] / GS4I_IS_LIQUID),
                        open = (gs4i_bits)0 - (gs4i_bits)(kind[i] & GS4I_IS_OPEN);
        gs4i_bits b, v;
        memcpy(&b, rhs + i, sizeof b);
        memcpy(&v, x + i, sizeof v);
        b = b & ~(gs4i_bits)0 >> 1 & liquid;
        v &= ~(gs4i_bits)0 >> 1;
        of_rhs = b > of_rhs ? b : of_rhs;
        of_air = (v & open & ~liquid) > of_air ? v & open & ~liquid : of_air;
        of_x = (v & liquid) > of_x ? v & liquid : of_x;
    }
    most[0] = of_rhs;
    most[1] = of_air;
    most[2] = of_x;
}

/* Largest right-hand side in liquid, x in air and x in liquid; infinity where one is not finite. */
static void gs4i_largest_given(int k, void *context)
{
    const gs4i_given *v = (const gs4i_given *)context;
    const gs4i_solver *s = v->s;
    const int *n = s->level[0].n;
    gs4i_bits most[3] = { 0, 0, 0 };
    gs4_real value;
    int a, j;
    for (j = 0; j < n[1]; j++) {
        const size_t row = ((size_t)k * (size_t)n[1] + (size_t)j) * (size_t)n[0];
        gs4i_largest_bits(v->rhs + row, v->x + row, gs4i_kinds_of(s, j, k), n[0], most);
    }
    for (a = 0; a < 3; a++) {
        memcpy(&value, &most[a], sizeof value);
        s->given[3 * k + a] = gs4i_finite(value) ? (double)value : HUGE_VAL;
    }
}

/* Right-hand side into r; into x the values of the air and, from a guess, of the liquid. */
static void gs4i_load_plane(int k, void *context)
{
    const gs4i_given *v = (const gs4i_given *)context;
    const gs4i_solver *s = v->s;
    const gs4i_level *g = &s->level[0];
    const double b = s->rhs_unit, unit = s->x_unit;
    int i, j, odd;
    for (j = 0; j < g->n[1]; j++)
        for (odd = 0; odd < 2; odd++) {
            const int c = (odd + j + k) & 1;
            const size_t row = ((size_t)k * (size_t)g->n[1] + (size_t)j) * (size_t)g->n[0],
                         at = gs4i_row_of(g, j, k);
            const uint8_t *kind = gs4i_kinds_of(s, j, k),
                          wanted = v->from == GS4I_FROM_GUESS ? GS4I_IS_OPEN | GS4I_IS_LIQUID
                                                              : GS4I_IS_OPEN;
            const int32_t *span = g->span + 2 * ((size_t)k * (size_t)g->n[1] + (size_t)j);
            const int end = 2 * span[1] < g->n[0] ? 2 * span[1] : g->n[0];
            double *r = g->r[c] + at, *x = s->x[c] + at;
            for (i = 2 * span[0] + odd; i < end; i += 2)
                r[i / 2] = kind[i] & GS4I_IS_LIQUID ? (double)v->rhs[row + (size_t)i] * b : 0;
            if (v->from == GS4I_FROM_ITERATE) continue;
            if (v->from == GS4I_FROM_ZERO && !v->air) {
                memset(x, 0, (size_t)g->width * sizeof *x);
                continue;
            }
            for (i = odd; i < g->n[0]; i += 2)
                x[i / 2] = kind[i] && (kind[i] & wanted) == kind[i]
                               ? (double)v->x[row + (size_t)i] * unit
                               : 0;
        }
}

static void gs4i_store_plane(int k, void *context)
{
    const gs4i_given *v = (const gs4i_given *)context;
    const gs4i_solver *s = v->s;
    const gs4i_level *g = &s->level[0];
    const double unit = 1 / s->x_unit;
    int i, j, odd;
    for (j = 0; j < g->n[1]; j++)
        for (odd = 0; odd < 2; odd++) {
            const uint8_t *kind = gs4i_kinds_of(s, j, k);
            const double *from = s->x[(odd + j + k) & 1] + gs4i_row_of(g, j, k);
            gs4_real *x = v->x + ((size_t)k * (size_t)g->n[1] + (size_t)j) * (size_t)g->n[0];
            for (i = odd; i < g->n[0]; i += 2)
                if (kind[i] & GS4I_IS_LIQUID) x[i] = (gs4_real)(from[i / 2] * unit);
        }
}

enum {
    GS4I_RUNS = 64
}; /* of pockets, a task */
typedef struct gs4i_means {
    gs4i_solver *s;
    double **v;
    int found;
} gs4i_means;

static double gs4i_sum_range(const double *v, int n)
{
    double sum[GS4I_STRIP] = { 0 };
    int m, l;
    for (m = 0; m + GS4I_STRIP <= n; m += GS4I_STRIP)
        for (l = 0; l < GS4I_STRIP; l++) sum[l] += v[m + l];
    for (l = 0; m + l < n; l++) sum[l] += v[m + l];
    return gs4i_sum_lanes(sum);
}

/* Sums of runs; once means are found, subtracts them. */
static void gs4i_sum_or_shift_runs(int index, void *context)
{
    const gs4i_means *w = (const gs4i_means *)context;
    const gs4i_level *g = &w->s->level[0];
    int a, c, m;
    for (a = GS4I_RUNS * index; a < GS4I_RUNS * (index + 1) && a < w->s->run_count; a++) {
        gs4i_run *run = &w->s->runs[a];
        const int j = run->row % g->n[1], k = run->row / g->n[1];
        const double mean = w->s->pocket[2 * run->pocket];
        if (!w->found) run->sum = 0;
        for (c = 0; c < 2; c++) {
            /* cells i = 2 m + t */
            const int t = (c + j + k) & 1, first = (run->begin + !t) / 2,
                      n = (run->end + !t) / 2 - first;
            double *v = w->v[c] + gs4i_row_of(g, j, k) + first;
            if (!w->found)
                run->sum += gs4i_sum_range(v, n);
            else
                for (m = 0; m < n; m++) v[m] -= mean;
        }
    }
}

/* Subtracts the mean of v in every closed pocket; gives the largest one. */
static double gs4i_subtract_means(gs4i_solver *s, double **v)
{
    const int tasks = (s->run_count + GS4I_RUNS - 1) / GS4I_RUNS;
    gs4i_means w;
    double largest = 0;
    int a, p;
    w.s = s;
    w.v = v;
    w.found = 0;
    gs4i_parallel_for(s->tasks, tasks, gs4i_sum_or_shift_runs, &w);
    for (p = 0; p < s->pockets; p++) s->pocket[2 * p] = 0;
    for (a = 0; a < s->run_count; a++) s->pocket[2 * s->runs[a].pocket] += s->runs[a].sum;
    for (p = 0; p < s->pockets; p++) {
        s->pocket[2 * p] /= s->pocket[2 * p + 1];
        if (fabs(s->pocket[2 * p]) > largest) largest = fabs(s->pocket[2 * p]);
    }
    w.found = 1;
    gs4i_parallel_for(s->tasks, tasks, gs4i_sum_or_shift_runs, &w);
    return largest;
}

/* r = b - A x; gives |r|. `removed`: the largest mean of b that closed pockets lose. */
static double gs4i_true_residual(gs4i_solver *s, gs4i_given *v, int from, double *removed)
{
    static const gs4i_pass_fn residual[] = { gs4i_pass_residual }, norm[] = { gs4i_pass_norm };
    double mean;
    v->from = from;
    gs4i_parallel_for(s->tasks, s->level[0].n[2], gs4i_load_plane, v);
    if (from == GS4I_FROM_GUESS) gs4i_subtract_means(s, s->x);
    mean = gs4i_subtract_means(s, s->level[0].r);
    if (removed) *removed = mean / s->rhs_unit;
    gs4i_wavefront_run(s, 0, from || v->air ? residual : norm, 1); /* A 0 = 0 */
    return sqrt(gs4i_sum_planes(s));
}

typedef enum gs4i_outcome {
    GS4I_CONVERGED,
    GS4I_LIMIT,
    GS4I_STAGNATED,
    GS4I_BROKE_DOWN
} gs4i_outcome;

/* How far a solve is: |r|, iterations so far, the least |r| of them and after which it was. */
typedef struct gs4i_progress {
    double norm, least;
    int iterations, least_at;
} gs4i_progress;

/* Conjugate gradients from r as it is until |r| <= goal. */
static gs4i_outcome gs4i_poisson_cg(gs4i_solver *s, double goal, int limit, int diagonal,
                                    gs4i_progress *now)
{
    static const gs4i_pass_fn jacobi[] = { gs4i_pass_jacobi, gs4i_pass_dot },
                              direct[] = { gs4i_pass_direction, gs4i_pass_p_dot_ap };
    static const gs4i_pass_fn update[] = { gs4i_pass_update };
    /* |r| need not fall in each iteration; over 30 it does where it converges at all */
    const int patience = diagonal ? 200 : 30;
    double last = 0, least = now->norm, look = now->norm;
    int i;
    for (i = 0; now->norm > goal; i++) {
        double rz, p_dot_ap;
        if (now->iterations >= limit) return GS4I_LIMIT;
        if (i && i % patience == 0) {
            if (least > 0.9 * look) return GS4I_STAGNATED;
            look = least;
        }
        if (diagonal) {
            gs4i_wavefront_run(s, 0, jacobi, 2);
            rz = gs4i_sum_planes(s);
        } else
            rz = gs4i_cycle(s);
        if (!(rz > 0 && rz <= DBL_MAX)) return GS4I_BROKE_DOWN;
        s->beta = i ? (float)(rz / last) : 0;
        last = rz;
        gs4i_wavefront_run(s, 0, direct, 2);
        p_dot_ap = gs4i_sum_planes(s);
        if (!(p_dot_ap > 0 && p_dot_ap <= DBL_MAX)) return GS4I_BROKE_DOWN;
        s->alpha = rz / p_dot_ap;
        gs4i_wavefront_run(s, 0, update, 1);
        now->norm = sqrt(gs4i_sum_planes(s));
        now->iterations++;
        if (!(now->norm <= DBL_MAX)) return GS4I_BROKE_DOWN;
        if (now->norm < least) least = now->norm;
        if (now->norm < now->least) {
            now->least = now->norm;
            now->least_at = now->iterations;
        }
    }
    return GS4I_CONVERGED;
}

/* Scales, and |b| with what flows in from the air; 0 if that is but rounding. */
static int gs4i_begin_solve(gs4i_solver *s, gs4i_given *v, double *norm, int *guess,
                            double *removed)
{
    double most[3] = { 0, 0, 0 }, b;
    int k, i, exponent = 0;
    gs4i_parallel_for(s->tasks, s->level[0].n[2], gs4i_largest_given, v);
    for (k = 0; k < s->level[0].n[2]; k++)
        for (i = 0; i < 3; i++)
            if (s->given[3 * k + i] > most[i]) most[i] = s->given[3 * k + i];
    if (!(most[0] < (double)GS4I_HUGE))
        return gs4i_fault(s, "the largest |rhs[]| in the liquid is ", most[0],
                          "; all must be finite and not absurdly large");
    if (!(most[1] < (double)GS4I_HUGE && most[2] < (double)GS4I_HUGE))
        return gs4i_fault(s, "the largest |x[]| in liquid and air is ",
                          most[1] > most[2] ? most[1] : most[2],
                          "; all must be finite and not absurdly large");
    b = most[0] * s->diagonal_unit > most[1] ? most[0] * s->diagonal_unit : most[1];
    frexp(b, &exponent);
    s->x_unit = ldexp(1, -exponent);
    s->rhs_unit = s->diagonal_unit * s->x_unit;
    *guess = most[2] > 0;
    v->air = most[1] > 0;
    *norm = gs4i_true_residual(s, v, GS4I_FROM_ZERO, removed);
    if (*norm <= 1e-13 * most[0] * s->rhs_unit * sqrt((double)s->unknowns)) *norm = 0;
    return GS4_OK;
}

/* A breakdown may leave NaN there. */
static void gs4i_clear_directions(gs4i_solver *s)
{
    int c;
    for (c = 0; c < 2; c++) {
        gs4i_clear(s, s->p[c], s->level[0].count * sizeof(float));
        gs4i_clear(s, s->level[0].z[c], s->level[0].count * sizeof(float));
        gs4i_clear(s, s->level[1].z[c], s->level[1].count * sizeof(float));
    }
}

/* What is said of each gs4i_outcome, before and after the residual. */
static const char *const gs4i_ends[4][2] = {
    { "", "" },
    { "the residual is ", " of the right-hand side after max_iterations; more of them, or a "
                          "larger tolerance, would do" },
    { "the residual stays at ", " of the right-hand side; a larger tolerance would do" },
    { "the iteration broke down, twice; the residual is ",
      " of the right-hand side; less contrast of coefficient and diagonal would do" }
};

/* From the guess or 0 to `goal`, or to as many iterations; now->norm is true at the end. */
static gs4i_outcome gs4i_iterate(gs4i_solver *s, gs4i_given *v, int from, double goal, int limit,
                                 gs4i_progress *now)
{
    gs4i_outcome end = GS4I_CONVERGED;
    double before = HUGE_VAL;
    int diagonal = 0;
    while (now->norm > goal) { /* until the true residual agrees */
        if (now->norm > 0.9 * before) return GS4I_STAGNATED;
        before = now->norm;
        end = gs4i_poisson_cg(s, goal, limit, diagonal, now);
        now->norm = gs4i_true_residual(s, v, GS4I_FROM_ITERATE, NULL);
        /* once more, preconditioned by the diagonal alone */
        if (end == GS4I_BROKE_DOWN) {
            gs4i_clear_directions(s);
            if (!(now->norm <= DBL_MAX)) now->norm = gs4i_true_residual(s, v, from, NULL);
            if (!diagonal) {
                diagonal = 1;
                before = HUGE_VAL;
                continue;
            }
        }
        if (end != GS4I_CONVERGED) return end;
    }
    return end;
}

/* Iterates improve in the energy norm: the residual of the last may be far above that of another.
 * The best one is found by going there again, so that no other solve pays for it. */
static void gs4i_return_to_best(gs4i_solver *s, gs4i_given *v, int from, double start, double goal,
                                gs4i_progress *now)
{
    if (s->returns_best && now->least_at && now->least < 0.999 * now->norm && now->least < start) {
        gs4i_progress again = *now;
        again.iterations = again.least_at = 0;
        gs4i_clear_directions(s);
        again.norm = again.least = gs4i_true_residual(s, v, from, NULL);
        gs4i_iterate(s, v, from, goal, now->least_at, &again);
        now->norm = again.norm;
    }
    if (!(now->norm <= start)) now->norm = gs4i_true_residual(s, v, from, NULL);
}

/* x: guess in the liquid and values in the air; out: the solution in the liquid, of mean 0 in
 * closed pockets. */
static int gs4i_solver_solve(gs4i_solver *s, const gs4_real *rhs, gs4_real *x, double tolerance,
                             int limit, gs4_solve_stats *stats)
{
    gs4i_given v;
    gs4i_progress now;
    gs4i_outcome end;
    double size, start;
    int guess, from;
    s->fault = NULL;
    v.s = s;
    v.rhs = rhs;
    v.x = x;
    v.from = v.air = 0;
    if (gs4i_begin_solve(s, &v, &size, &guess, &stats->removed_mean) != GS4_OK)
        return GS4_ERROR_ARGUMENT;
    stats->pockets = s->pockets;
    start = size;
    from = guess ? GS4I_FROM_GUESS : GS4I_FROM_ZERO;
    if (guess && size > 0) start = gs4i_true_residual(s, &v, GS4I_FROM_GUESS, NULL);
    /* a guess that is worse than 0 is dropped */
    if (!(start <= size)) {
        from = GS4I_FROM_ZERO;
        start = gs4i_true_residual(s, &v, from, NULL);
    }
    now.norm = now.least = start;
    now.iterations = now.least_at = 0;
    end = gs4i_iterate(s, &v, from, tolerance * size, limit, &now);
    stats->iterations = now.iterations;
    if (!(now.norm <= tolerance * size))
        gs4i_return_to_best(s, &v, from, start, tolerance * size, &now);
    gs4i_subtract_means(s, s->x);
    gs4i_parallel_for(s->tasks, s->level[0].n[2], gs4i_store_plane, &v);
    stats->residual = size > 0 ? now.norm / size : 0;
    if (now.norm <= tolerance * size) return GS4_OK;
    s->fault = gs4i_ends[end][0];
    s->accepted = gs4i_ends[end][1];
    return GS4_ERROR_NOT_CONVERGED;
}

/* ==== [[krylov]] conjugate gradients for any operator ========================================== *
 *
 * Preconditioned conjugate gradients (Hestenes & Stiefel 1952) in double for A x = b, A symmetric
 * and positive definite, of which only products are asked. Dot products are sums in the order of
 * the array, by one thread: the same bits for any number of threads. */

typedef struct gs4i_krylov {
    size_t n;
    /* n numbers each, 0 where there is no unknown: solution; residual, b at the start;
     * direction; M^-1 r, then A p */
    double *x, *r, *p, *q;
    void (*apply)(void *context, const double *p, double *out); /* A p */
    /* M^-1 r, M fixed, symmetric, positive definite; gives GS4_OK, or what ends the solve */
    int (*precondition)(void *context, const double *r, double *out);
    void *context;
    double residual; /* |r| / |b| of the last look; 1 and x = 0 after a breakdown */
} gs4i_krylov;

static double gs4i_krylov_dot(const double *a, const double *b, size_t n)
{
    double sum = 0;
    size_t i;
    for (i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* From x = 0 until |r| <= tolerance |b|. */
static int gs4i_conjugate_gradients(gs4i_krylov *k, double tolerance, int max_iterations)
{
    const double size = sqrt(gs4i_krylov_dot(k->r, k->r, k->n));
    double rz = 0;
    size_t i;
    int iteration;
    for (i = 0; i < k->n; i++) k->x[i] = k->p[i] = 0;
    for (iteration = 0;; iteration++) {
        const double norm = sqrt(gs4i_krylov_dot(k->r, k->r, k->n)), before = rz;
        double beta, alpha;
        int result;
        k->residual = size > 0 ? norm / size : 0;
        if (!(norm <= DBL_MAX)) {
            for (i = 0; i < k->n; i++) k->x[i] = 0;
            k->residual = 1;
            return GS4_ERROR_NOT_CONVERGED;
        }
        if (norm <= tolerance * size) return GS4_OK;
        if (iteration >= max_iterations) return GS4_ERROR_NOT_CONVERGED;
        result = k->precondition(k->context, k->r, k->q);
        if (result != GS4_OK) return result;
        rz = gs4i_krylov_dot(k->r, k->q, k->n);
        beta = iteration ? rz / before : 0;
        for (i = 0; i < k->n; i++) k->p[i] = k->q[i] + beta * k->p[i];
        k->apply(k->context, k->p, k->q);
        alpha = rz / gs4i_krylov_dot(k->p, k->q, k->n);
        for (i = 0; i < k->n; i++) {
            k->x[i] += alpha * k->p[i];
            k->r[i] -= alpha * k->q[i];
        }
    }
}

/* ==== [[kernel]] quadratic B-splines on 27 nodes =============================================== *
 *
 * Nodes are cell centres. A particle in cell c sees nodes c-1, c, c+1 along each axis. Its offset
 * from the centre of c is xi, in cells, -1/2 <= xi < 1/2:
 *
 *        node c-1         node c        node c+1
 *     ------o-------|-------o---x---|-------o------
 *                   |<--- cell c -->|
 *
 *     w  = (1/2 - xi)^2 / 2,  3/4 - xi^2,  (1/2 + xi)^2 / 2
 *     w' = -(1/2 - xi),       -2 xi,        1/2 + xi
 *     sum w = 1,   sum w (x_i - x) = 0,   sum w (x_i - x)^2 = h^2/4
 *
 * Products of three are the weights, w_i = w_x w_y w_z. A block is 4^3 nodes, its particles are
 * neighbours in memory. Transfers work on a tile of 8^3 nodes, a block with two nodes around it.
 * So a particle may stray one cell from its block before it must be sorted anew. A node is four
 * numbers. Three nodes along x are twelve contiguous ones: the `row` below. */

#define GS4I_BLOCK_SIDE 4
#define GS4I_BLOCK_NODES 64
#define GS4I_TILE 8 /* nodes along the edge of a tile */
/* a row read may run 4 numbers over the end */
#define GS4I_TILE_REALS (4 * GS4I_TILE * GS4I_TILE * GS4I_TILE + 16)

/* Four and sixteen numbers at a time, by compiler vectors where there are any, else by arrays. The
 * arithmetic and its order are the same, so the bits are. Lane 3 of a quad often means nothing.
 * gcc without AVX breaks four doubles up badly: arrays there. */
#if defined(__has_builtin) && !defined(GS4_NO_VECTORS) \
    && (!defined(GS4_DOUBLE) || defined(__AVX__) || defined(__clang__))
#if __has_builtin(__builtin_shufflevector) && __has_builtin(__builtin_convertvector)
#define GS4I_VECTORS 1
#endif
#endif
#ifdef GS4I_VECTORS
typedef gs4_real gs4i_quad __attribute__((vector_size(4 * sizeof(gs4_real))));
#ifdef GS4_DOUBLE
typedef int64_t gs4i_mask __attribute__((vector_size(32)));
#else
typedef int32_t gs4i_mask __attribute__((vector_size(16)));
#endif
#define GS4I_LANE(v, i) ((v)[i])
#define GS4I_LANES(...) __VA_ARGS__
#define GS4I_MUL(r, a, b) ((r) = (a) * (b))        /* r = a b   lane by lane */
#define GS4I_MAD(r, a, b) ((r) += (a) * (b))       /* r += a b  lane by lane */
#define GS4I_SPLAT_MUL(r, s, a) ((r) = (a) * (s))  /* r = s a   for a number s */
#define GS4I_SPLAT_MAD(r, s, a) ((r) += (a) * (s)) /* r += s a */
#define GS4I_SUM(r, a, b) ((r) = (a) + (b))
#define GS4I_DIFFERENCE(r, a, b) ((r) = (a) - (b))
#define GS4I_GREATER(r, a, b)                                                    \
    do {                                                                         \
        const gs4i_mask gs4i_m = (a) > (b);                                      \
        (r) = (gs4i_quad)(((gs4i_mask)(a)&gs4i_m) | ((gs4i_mask)(b) & ~gs4i_m)); \
    } while (0)
#else
typedef struct gs4i_quad {
    gs4_real lane[4];
} gs4i_quad;
#define GS4I_LANE(v, i) ((v).lane[i])
#define GS4I_LANES(...) \
    {                   \
        __VA_ARGS__     \
    }
#define GS4I_EACH(r, expression)                                                   \
    do {                                                                           \
        int gs4i_l;                                                                \
        for (gs4i_l = 0; gs4i_l < (int)(sizeof(r) / sizeof(gs4_real)); gs4i_l++) { \
            expression;                                                            \
        }                                                                          \
    } while (0)
#define GS4I_MUL(r, a, b) GS4I_EACH(r, (r).lane[gs4i_l] = (a).lane[gs4i_l] * (b).lane[gs4i_l])
#define GS4I_MAD(r, a, b) GS4I_EACH(r, (r).lane[gs4i_l] += (a).lane[gs4i_l] * (b).lane[gs4i_l])
#define GS4I_SPLAT_MUL(r, s, a) GS4I_EACH(r, (r).lane[gs4i_l] = (a).lane[gs4i_l] * (s))
#define GS4I_SPLAT_MAD(r, s, a) GS4I_EACH(r, (r).lane[gs4i_l] += (a).lane[gs4i_l] * (s))
#define GS4I_SUM(r, a, b) GS4I_EACH(r, (r).lane[gs4i_l] = (a).lane[gs4i_l] + (b).lane[gs4i_l])
#define GS4I_DIFFERENCE(r, a, b) \
    GS4I_EACH(r, (r).lane[gs4i_l] = (a).lane[gs4i_l] - (b).lane[gs4i_l])
#define GS4I_GREATER(r, a, b)       \
    GS4I_EACH(r, (r).lane[gs4i_l] = \
                     (a).lane[gs4i_l] > (b).lane[gs4i_l] ? (a).lane[gs4i_l] : (b).lane[gs4i_l])
#endif

#define GS4I_LOAD(v, p) memcpy(&(v), (p), sizeof(v))
#define GS4I_STORE(p, v) memcpy((p), &(v), sizeof(v))

/* A row is one vector of sixteen where the machine has such, two of eight where it has those, else
 * three quads. Longer vectors than the machine has are not left to the compiler: gcc was four times
 * slower with them. */
#if defined(GS4I_VECTORS) && defined(__AVX__) && !defined(GS4_DOUBLE)
typedef gs4_real gs4i_pair __attribute__((vector_size(8 * sizeof(gs4_real))));
#define GS4I_PAIRS 1
#endif
#if defined(GS4I_VECTORS) && defined(__AVX512F__) && !defined(GS4_DOUBLE)
#define GS4I_LONG_ROWS 1
typedef gs4_real gs4i_row __attribute__((vector_size(16 * sizeof(gs4_real))));
#define GS4I_ROW_LOAD GS4I_LOAD
#define GS4I_ROW_STORE GS4I_STORE
#define GS4I_ROW_MUL GS4I_MUL
#define GS4I_ROW_MAD GS4I_MAD
#define GS4I_ROW_SPLAT_MUL GS4I_SPLAT_MUL
#define GS4I_ROW_SPLAT_MAD GS4I_SPLAT_MAD
#define GS4I_ROW_SUM GS4I_SUM
#define GS4I_ROW_DIFFERENCE GS4I_DIFFERENCE
#elif defined(GS4I_PAIRS)
typedef struct gs4i_row {
    gs4i_pair ab, cd;
} gs4i_row;
/* s in eight lanes, made once for both halves */
#define GS4I_SPREAD(s)           \
    const gs4_real gs4i_n = (s); \
    const gs4i_pair gs4i_s = { gs4i_n, gs4i_n, gs4i_n, gs4i_n, gs4i_n, gs4i_n, gs4i_n, gs4i_n }
#define GS4I_ROW_LOAD(v, p)         \
    do {                            \
        GS4I_LOAD((v).ab, p);       \
        GS4I_LOAD((v).cd, (p) + 8); \
    } while (0)
#define GS4I_ROW_STORE(p, v)         \
    do {                             \
        GS4I_STORE(p, (v).ab);       \
        GS4I_STORE((p) + 8, (v).cd); \
    } while (0)
#define GS4I_ROW_MUL(r, x, y)             \
    do {                                  \
        GS4I_MUL((r).ab, (x).ab, (y).ab); \
        GS4I_MUL((r).cd, (x).cd, (y).cd); \
    } while (0)
#define GS4I_ROW_MAD(r, x, y)             \
    do {                                  \
        GS4I_MAD((r).ab, (x).ab, (y).ab); \
        GS4I_MAD((r).cd, (x).cd, (y).cd); \
    } while (0)
#define GS4I_ROW_SPLAT_MUL(r, s, x)       \
    do {                                  \
        GS4I_SPREAD(s);                   \
        GS4I_MUL((r).ab, gs4i_s, (x).ab); \
        GS4I_MUL((r).cd, gs4i_s, (x).cd); \
    } while (0)
#define GS4I_ROW_SPLAT_MAD(r, s, x)       \
    do {                                  \
        GS4I_SPREAD(s);                   \
        GS4I_MAD((r).ab, gs4i_s, (x).ab); \
        GS4I_MAD((r).cd, gs4i_s, (x).cd); \
    } while (0)
#define GS4I_ROW_SUM(r, x, y)             \
    do {                                  \
        GS4I_SUM((r).ab, (x).ab, (y).ab); \
        GS4I_SUM((r).cd, (x).cd, (y).cd); \
    } while (0)
#define GS4I_ROW_DIFFERENCE(r, x, y)             \
    do {                                         \
        GS4I_DIFFERENCE((r).ab, (x).ab, (y).ab); \
        GS4I_DIFFERENCE((r).cd, (x).cd, (y).cd); \
    } while (0)
#else
typedef struct gs4i_row {
    gs4i_quad a, b, c;
} gs4i_row; /* one quad a node */
#define GS4I_ROW_LOAD(v, p)        \
    do {                           \
        GS4I_LOAD((v).a, p);       \
        GS4I_LOAD((v).b, (p) + 4); \
        GS4I_LOAD((v).c, (p) + 8); \
    } while (0)
#define GS4I_ROW_STORE(p, v)        \
    do {                            \
        GS4I_STORE(p, (v).a);       \
        GS4I_STORE((p) + 4, (v).b); \
        GS4I_STORE((p) + 8, (v).c); \
    } while (0)
#define GS4I_ROW_MUL(r, x, y)          \
    do {                               \
        GS4I_MUL((r).a, (x).a, (y).a); \
        GS4I_MUL((r).b, (x).b, (y).b); \
        GS4I_MUL((r).c, (x).c, (y).c); \
    } while (0)
#define GS4I_ROW_MAD(r, x, y)          \
    do {                               \
        GS4I_MAD((r).a, (x).a, (y).a); \
        GS4I_MAD((r).b, (x).b, (y).b); \
        GS4I_MAD((r).c, (x).c, (y).c); \
    } while (0)
#define GS4I_ROW_SPLAT_MUL(r, s, x)      \
    do {                                 \
        GS4I_SPLAT_MUL((r).a, s, (x).a); \
        GS4I_SPLAT_MUL((r).b, s, (x).b); \
        GS4I_SPLAT_MUL((r).c, s, (x).c); \
    } while (0)
#define GS4I_ROW_SPLAT_MAD(r, s, x)      \
    do {                                 \
        GS4I_SPLAT_MAD((r).a, s, (x).a); \
        GS4I_SPLAT_MAD((r).b, s, (x).b); \
        GS4I_SPLAT_MAD((r).c, s, (x).c); \
    } while (0)
#define GS4I_ROW_SUM(r, x, y)          \
    do {                               \
        GS4I_SUM((r).a, (x).a, (y).a); \
        GS4I_SUM((r).b, (x).b, (y).b); \
        GS4I_SUM((r).c, (x).c, (y).c); \
    } while (0)
#define GS4I_ROW_DIFFERENCE(r, x, y)          \
    do {                                      \
        GS4I_DIFFERENCE((r).a, (x).a, (y).a); \
        GS4I_DIFFERENCE((r).b, (x).b, (y).b); \
        GS4I_DIFFERENCE((r).c, (x).c, (y).c); \
    } while (0)
#endif

/* (a a a a  b b b b  c c c c): one number a node, spread over its four lanes */
GS4I_INLINE void gs4i_row_of_nodes(gs4i_row *r, gs4_real a, gs4_real b, gs4_real c)
{
#ifdef GS4I_LONG_ROWS
    const gs4i_row all = { a, a, a, a, b, b, b, b, c, c, c, c, 0, 0, 0, 0 };
#elif defined(GS4I_PAIRS)
    const gs4i_row all = { { a, a, a, a, b, b, b, b }, { c, c, c, c, 0, 0, 0, 0 } };
#else
    const gs4i_row all = { { GS4I_LANES(a, a, a, a) },
                           { GS4I_LANES(b, b, b, b) },
                           { GS4I_LANES(c, c, c, c) } };
#endif
    *r = all;
}

/* (x y z w  x y z w  x y z w): the same four numbers for each node */
GS4I_INLINE void gs4i_row_of_quad(gs4i_row *r, const gs4i_quad *q)
{
#ifdef GS4I_LONG_ROWS
    /* doubled twice: in one go gcc goes through memory */
    const gs4i_pair p = __builtin_shufflevector(*q, *q, 0, 1, 2, 3, 0, 1, 2, 3);
    *r = __builtin_shufflevector(p, p, 0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7);
#elif defined(GS4I_PAIRS)
    r->ab = r->cd = __builtin_shufflevector(*q, *q, 0, 1, 2, 3, 0, 1, 2, 3);
#else
    r->a = *q;
    r->b = *q;
    r->c = *q;
#endif
}

#ifdef GS4I_VECTORS
/* r[i] = (from[i] from[apart + i] from[2 apart + i] from[3 apart + i]) */
GS4I_INLINE void gs4i_transpose(const gs4_real *from, int apart, gs4i_quad r[4])
{
    gs4i_quad a, b, c, d, low, high, Low, High;
    GS4I_LOAD(a, from);
    GS4I_LOAD(b, from + apart);
    GS4I_LOAD(c, from + 2 * apart);
    GS4I_LOAD(d, from + 3 * apart);
    low = __builtin_shufflevector(a, b, 0, 4, 1, 5);
    high = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    Low = __builtin_shufflevector(c, d, 0, 4, 1, 5);
    High = __builtin_shufflevector(c, d, 2, 6, 3, 7);
    r[0] = __builtin_shufflevector(low, Low, 0, 1, 4, 5);
    r[1] = __builtin_shufflevector(low, Low, 2, 3, 6, 7);
    r[2] = __builtin_shufflevector(high, High, 0, 1, 4, 5);
    r[3] = __builtin_shufflevector(high, High, 2, 3, 6, 7);
}
#endif

/* q = sum over the nodes of a row of x_i y_i: (node 0 + node 2) + node 1 */
GS4I_INLINE void gs4i_row_dot(gs4i_quad *q, const gs4i_row *x, const gs4i_row *y)
{
    gs4i_row t;
    GS4I_ROW_MUL(t, *x, *y);
#ifdef GS4I_LONG_ROWS
    {
        const gs4i_pair p = __builtin_shufflevector(t, t, 0, 1, 2, 3, 4, 5, 6, 7)
                            + __builtin_shufflevector(t, t, 8, 9, 10, 11, 12, 13, 14, 15);
        *q = __builtin_shufflevector(p, p, 0, 1, 2, 3) + __builtin_shufflevector(p, p, 4, 5, 6, 7);
    }
#elif defined(GS4I_PAIRS)
    t.cd += t.ab;
    *q = __builtin_shufflevector(t.cd, t.cd, 0, 1, 2, 3)
         + __builtin_shufflevector(t.ab, t.ab, 4, 5, 6, 7);
#else
    GS4I_SUM(*q, t.a, t.c);
    GS4I_SUM(*q, *q, t.b);
#endif
}

/* Sixteen particles of a block go together, a batch. What each does by itself is done for
 * GS4I_WIDTH of them at a time, one number of each side by side in a `wide`. That is the widest
 * vector of the machine, or a plain number where there are none. Formulas are written once, in
 * loops over the wides of a batch. */
enum {
    GS4I_BATCH = 16
};
#ifndef GS4I_VECTORS
#define GS4I_WIDTH 1
typedef gs4_real gs4i_wide;
#ifdef GS4_DOUBLE
typedef int64_t gs4i_wide_bits;
#else
typedef int32_t gs4i_wide_bits;
#endif
typedef int32_t gs4i_wide_int;
typedef int gs4i_wide_mask;
/* r = mask ? x : y  lane by lane */
#define GS4I_CHOOSE(r, mask, x, y) ((r) = (mask) ? (x) : (y))
#define GS4I_CHOOSE_INT GS4I_CHOOSE
#define GS4I_TRUNCATE(i, x) ((i) = (int32_t)(x))
#define GS4I_TO_REAL(x, i) ((x) = (gs4_real)(i))
#else
#if defined(__AVX512F__) && !defined(GS4_DOUBLE)
#define GS4I_WIDTH 16
#elif defined(__AVX512F__) || (defined(__AVX__) && !defined(GS4_DOUBLE))
#define GS4I_WIDTH 8
#else
#define GS4I_WIDTH 4
#endif
typedef gs4_real gs4i_wide __attribute__((vector_size(GS4I_WIDTH * sizeof(gs4_real)), may_alias));
typedef int32_t gs4i_wide_int __attribute__((vector_size(GS4I_WIDTH * sizeof(int32_t)), may_alias));
#ifdef GS4_DOUBLE
typedef int64_t gs4i_wide_mask __attribute__((vector_size(GS4I_WIDTH * sizeof(int64_t))));
#else
typedef int32_t gs4i_wide_mask __attribute__((vector_size(GS4I_WIDTH * sizeof(int32_t))));
#endif
typedef gs4i_wide_mask gs4i_wide_bits;
#define GS4I_CHOOSE(r, mask, x, y)                                                         \
    do {                                                                                   \
        const gs4i_wide_mask gs4i_m = (mask);                                              \
        (r) = (gs4i_wide)(((gs4i_wide_mask)(x)&gs4i_m) | ((gs4i_wide_mask)(y) & ~gs4i_m)); \
    } while (0)
#define GS4I_CHOOSE_INT(r, mask, x, y)        \
    do {                                      \
        const gs4i_wide_int gs4i_m = (mask);  \
        (r) = ((x)&gs4i_m) | ((y) & ~gs4i_m); \
    } while (0)
#define GS4I_TRUNCATE(i, x) ((i) = __builtin_convertvector(x, gs4i_wide_int))
#define GS4I_TO_REAL(x, i) ((x) = __builtin_convertvector(i, gs4i_wide))
#endif
#define GS4I_WIDE_MAX(r, x, y) GS4I_CHOOSE(r, (x) > (y), x, y)
#define GS4I_WIDE_MIN(r, x, y) GS4I_CHOOSE(r, (x) < (y), x, y)

/* one number of each particle of a batch */
typedef gs4i_wide gs4i_lanes[GS4I_BATCH / GS4I_WIDTH];
#define GS4I_BATCH_LOOP(b) for (b = 0; b < GS4I_BATCH / GS4I_WIDTH; b++)
#define GS4I_NTH(lanes, n) (((gs4_real *)(lanes))[n]) /* of particle n */
#define GS4I_NTH_CONST(lanes, n) (((const gs4_real *)(lanes))[n])

/* Does the mask hold for all? */
GS4I_INLINE int gs4i_all(const gs4i_wide_mask *mask)
{
#if GS4I_WIDTH == 1
    return *mask;
#else
    uint64_t words[sizeof *mask / 8], all = ~(uint64_t)0;
    size_t i;
    memcpy(words, mask, sizeof words);
    for (i = 0; i < sizeof *mask / 8; i++) all &= words[i];
    return all == ~(uint64_t)0;
#endif
}

#if GS4I_WIDTH == 16
/* (a b c d) of each of four particles, one after the other */
GS4I_INLINE void gs4i_load_four(const gs4_real *from, int apart, gs4i_wide *p)
{
    gs4i_quad a, b, c, d;
    gs4i_pair ab, cd;
    if (apart == 4) {
        GS4I_LOAD(*p, from);
        return;
    }
    GS4I_LOAD(a, from);
    GS4I_LOAD(b, from + apart);
    GS4I_LOAD(c, from + 2 * apart);
    GS4I_LOAD(d, from + 3 * apart);
    ab = __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
    cd = __builtin_shufflevector(c, d, 0, 1, 2, 3, 4, 5, 6, 7);
    *p = __builtin_shufflevector(ab, cd, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
}
#endif

/* (a b c d) of each of sixteen particles, whose numbers are `apart`, into four lanes */
GS4I_INLINE void gs4i_sixteen_to_lanes(const gs4_real *from, int apart, gs4i_lanes to[4])
{
#if GS4I_WIDTH == 16
    gs4i_wide p0, p1, p2, p3, xy, zw, XY, ZW;
    gs4i_load_four(from, apart, &p0);
    gs4i_load_four(from + 4 * apart, apart, &p1);
    gs4i_load_four(from + 8 * apart, apart, &p2);
    gs4i_load_four(from + 12 * apart, apart, &p3);
    xy = __builtin_shufflevector(p0, p1, 0, 4, 8, 12, 16, 20, 24, 28, 1, 5, 9, 13, 17, 21, 25, 29);
    zw =
        __builtin_shufflevector(p0, p1, 2, 6, 10, 14, 18, 22, 26, 30, 3, 7, 11, 15, 19, 23, 27, 31);
    XY = __builtin_shufflevector(p2, p3, 0, 4, 8, 12, 16, 20, 24, 28, 1, 5, 9, 13, 17, 21, 25, 29);
    ZW =
        __builtin_shufflevector(p2, p3, 2, 6, 10, 14, 18, 22, 26, 30, 3, 7, 11, 15, 19, 23, 27, 31);
    to[0][0] =
        __builtin_shufflevector(xy, XY, 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23);
    to[1][0] = __builtin_shufflevector(xy, XY, 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26, 27, 28, 29,
                                       30, 31);
    to[2][0] =
        __builtin_shufflevector(zw, ZW, 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23);
    to[3][0] = __builtin_shufflevector(zw, ZW, 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26, 27, 28, 29,
                                       30, 31);
#elif GS4I_WIDTH == 8
    int b, i;
    for (b = 0; b < 2; b++) {
        gs4i_wide p[4], xy, zw, XY, ZW; /* particles 0 and 4, 1 and 5, ... */
        for (i = 0; i < 4; i++, from += apart) {
            gs4i_quad low, high;
            GS4I_LOAD(low, from);
            GS4I_LOAD(high, from + 4 * apart);
            p[i] = __builtin_shufflevector(low, high, 0, 1, 2, 3, 4, 5, 6, 7);
        }
        from += 4 * apart;
        xy = __builtin_shufflevector(p[0], p[1], 0, 8, 1, 9, 4, 12, 5, 13);
        zw = __builtin_shufflevector(p[0], p[1], 2, 10, 3, 11, 6, 14, 7, 15);
        XY = __builtin_shufflevector(p[2], p[3], 0, 8, 1, 9, 4, 12, 5, 13);
        ZW = __builtin_shufflevector(p[2], p[3], 2, 10, 3, 11, 6, 14, 7, 15);
        to[0][b] = __builtin_shufflevector(xy, XY, 0, 1, 8, 9, 4, 5, 12, 13);
        to[1][b] = __builtin_shufflevector(xy, XY, 2, 3, 10, 11, 6, 7, 14, 15);
        to[2][b] = __builtin_shufflevector(zw, ZW, 0, 1, 8, 9, 4, 5, 12, 13);
        to[3][b] = __builtin_shufflevector(zw, ZW, 2, 3, 10, 11, 6, 7, 14, 15);
    }
#elif GS4I_WIDTH == 4
    gs4i_quad c[4];
    int b, i;
    for (b = 0; b < GS4I_BATCH / 4; b++, from += 4 * apart) {
        gs4i_transpose(from, apart, c);
        for (i = 0; i < 4; i++) to[i][b] = c[i];
    }
#else
    int b, i;
    for (b = 0; b < GS4I_BATCH; b++)
        for (i = 0; i < 4; i++) to[i][b] = from[apart * b + i];
#endif
}

/* The same of n particles. Lanes beyond hold the first particle again, so that no arithmetic
 * there overflows. */
GS4I_INLINE void gs4i_to_lanes(const gs4_real *from, int n, gs4i_lanes to[4])
{
    gs4_real filled[4 * GS4I_BATCH];
    int b;
    if (n < GS4I_BATCH) {
        memcpy(filled, from, 4 * (size_t)n * sizeof *from);
        for (b = n; b < GS4I_BATCH; b++) memcpy(filled + 4 * b, from, 4 * sizeof *from);
        from = filled;
    }
    gs4i_sixteen_to_lanes(from, 4, to);
}

/* From four lanes to (x y z w) of each particle. */
GS4I_INLINE void gs4i_from_lanes(const gs4i_wide *x, const gs4i_wide *y, const gs4i_wide *z,
                                 const gs4i_wide *w, gs4_real to[4 * GS4I_BATCH])
{
#if GS4I_WIDTH == 16
    /* of particles 0 1 4 5 8 9 .. */
    const gs4i_wide xy =
        __builtin_shufflevector(*x, *y, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
    const gs4i_wide XY =
        __builtin_shufflevector(*x, *y, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
    const gs4i_wide zw =
        __builtin_shufflevector(*z, *w, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29);
    const gs4i_wide ZW =
        __builtin_shufflevector(*z, *w, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31);
    /* 0 1 4 5 */
    const gs4i_wide p04 =
        __builtin_shufflevector(xy, zw, 0, 1, 16, 17, 2, 3, 18, 19, 4, 5, 20, 21, 6, 7, 22, 23);
    const gs4i_wide p8c = __builtin_shufflevector(xy, zw, 8, 9, 24, 25, 10, 11, 26, 27, 12, 13, 28,
                                                  29, 14, 15, 30, 31);
    /* 2 3 6 7 */
    const gs4i_wide p26 =
        __builtin_shufflevector(XY, ZW, 0, 1, 16, 17, 2, 3, 18, 19, 4, 5, 20, 21, 6, 7, 22, 23);
    const gs4i_wide pae = __builtin_shufflevector(XY, ZW, 8, 9, 24, 25, 10, 11, 26, 27, 12, 13, 28,
                                                  29, 14, 15, 30, 31);
    const gs4i_wide p0 =
        __builtin_shufflevector(p04, p26, 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23);
    const gs4i_wide p4 = __builtin_shufflevector(p04, p26, 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26,
                                                 27, 28, 29, 30, 31);
    const gs4i_wide p8 =
        __builtin_shufflevector(p8c, pae, 0, 1, 2, 3, 4, 5, 6, 7, 16, 17, 18, 19, 20, 21, 22, 23);
    const gs4i_wide pc = __builtin_shufflevector(p8c, pae, 8, 9, 10, 11, 12, 13, 14, 15, 24, 25, 26,
                                                 27, 28, 29, 30, 31);
    GS4I_STORE(to, p0);
    GS4I_STORE(to + 16, p4);
    GS4I_STORE(to + 32, p8);
    GS4I_STORE(to + 48, pc);
#elif GS4I_WIDTH == 8
    int b;
    for (b = 0; b < 2; b++, to += 32) {
        const gs4i_wide xy = __builtin_shufflevector(x[b], y[b], 0, 8, 1, 9, 4, 12, 5, 13),
                        XY = __builtin_shufflevector(x[b], y[b], 2, 10, 3, 11, 6, 14, 7, 15);
        const gs4i_wide zw = __builtin_shufflevector(z[b], w[b], 0, 8, 1, 9, 4, 12, 5, 13),
                        ZW = __builtin_shufflevector(z[b], w[b], 2, 10, 3, 11, 6, 14, 7, 15);
        const gs4i_wide p04 = __builtin_shufflevector(xy, zw, 0, 1, 8, 9, 4, 5, 12, 13),
                        p15 = __builtin_shufflevector(xy, zw, 2, 3, 10, 11, 6, 7, 14, 15);
        const gs4i_wide p26 = __builtin_shufflevector(XY, ZW, 0, 1, 8, 9, 4, 5, 12, 13),
                        p37 = __builtin_shufflevector(XY, ZW, 2, 3, 10, 11, 6, 7, 14, 15);
        const gs4i_wide p01 = __builtin_shufflevector(p04, p15, 0, 1, 2, 3, 8, 9, 10, 11),
                        p23 = __builtin_shufflevector(p26, p37, 0, 1, 2, 3, 8, 9, 10, 11);
        const gs4i_wide p45 = __builtin_shufflevector(p04, p15, 4, 5, 6, 7, 12, 13, 14, 15),
                        p67 = __builtin_shufflevector(p26, p37, 4, 5, 6, 7, 12, 13, 14, 15);
        GS4I_STORE(to, p01);
        GS4I_STORE(to + 8, p23);
        GS4I_STORE(to + 16, p45);
        GS4I_STORE(to + 24, p67);
    }
#elif GS4I_WIDTH == 4
    int b;
    for (b = 0; b < GS4I_BATCH; b += 4) {
        gs4_real four[16];
        gs4i_quad c[4];
        int i;
        memcpy(four, (const gs4_real *)x + b, 4 * sizeof *four);
        memcpy(four + 4, (const gs4_real *)y + b, 4 * sizeof *four);
        memcpy(four + 8, (const gs4_real *)z + b, 4 * sizeof *four);
        memcpy(four + 12, (const gs4_real *)w + b, 4 * sizeof *four);
        gs4i_transpose(four, 4, c);
        for (i = 0; i < 4; i++) GS4I_STORE(to + 4 * (b + i), c[i]);
    }
#else
    int b;
    for (b = 0; b < GS4I_BATCH; b++) {
        to[4 * b] = x[b];
        to[4 * b + 1] = y[b];
        to[4 * b + 2] = z[b];
        to[4 * b + 3] = w[b];
    }
#endif
}

/* `reals` numbers of each of n particles, side by side in memory, into as many lanes. Not one
 * number more is read: another task may be writing those behind, of another block. */
GS4I_INLINE void gs4i_numbers_to_lanes(const gs4_real *from, int reals, int n, gs4i_lanes *l)
{
    gs4_real four[4 * GS4I_BATCH];
    gs4i_lanes last[4];
    int part, b;
    for (part = 0; 4 * part + 4 <= reals; part++) {
        if (n == GS4I_BATCH) {
            gs4i_sixteen_to_lanes(from + 4 * part, reals, l + 4 * part);
            continue;
        }
        for (b = 0; b < n; b++) memcpy(four + 4 * b, from + reals * b + 4 * part, 4 * sizeof *four);
        gs4i_to_lanes(four, n, l + 4 * part);
    }
    if (4 * part == reals) return;
    memset(four, 0, sizeof four);
    for (b = 0; b < n; b++)
        memcpy(four + 4 * b, from + reals * b + 4 * part,
               (size_t)(reals - 4 * part) * sizeof *four);
    gs4i_to_lanes(four, n, last);
    memcpy(l + 4 * part, last, (size_t)(reals - 4 * part) * sizeof *last);
}

/* From lanes to memory. */
GS4I_INLINE void gs4i_lanes_to_numbers(gs4i_lanes *l, int reals, int n, gs4_real *to)
{
    gs4_real four[4 * GS4I_BATCH];
    int part, b;
    for (part = 0; 4 * part + 4 <= reals; part++) {
        gs4i_from_lanes(l[4 * part], l[4 * part + 1], l[4 * part + 2], l[4 * part + 3], four);
        for (b = 0; b < n; b++) memcpy(to + reals * b + 4 * part, four + 4 * b, 4 * sizeof *four);
    }
    for (part *= 4; part < reals; part++)
        for (b = 0; b < n; b++) to[reals * b + part] = GS4I_NTH(l[part], b);
}

/* Weights and derivatives (1/m) of a batch, [axis][node], and where each particle's first node
 * is in the tile. */
typedef struct gs4i_stencils {
    gs4i_lanes w[3][3], d[3][3];
    gs4i_lanes xi[3]; /* offset from the centre of its cell, in cells */
    /* number of its first node in the tile, or -1: outside of it */
    int32_t base[GS4I_BATCH];
} gs4i_stencils;

/* From the domain to tile coordinates: (x - origin) / h - first; a particle there is in the cell
 * of node floor(x). */
typedef struct gs4i_frame {
    gs4_real origin[3], first[3], inv_h;
} gs4i_frame;

/* Tile coordinates outside of 1 <= x < 7, and NaN, give base -1: their nodes are not all there. */
GS4I_INLINE void gs4i_stencils_at(gs4i_stencils *s, const gs4i_frame *f, gs4i_lanes x[3])
{
    gs4i_wide_int base;
    gs4i_wide zero;
    int a, b;
    memset(&zero, 0, sizeof zero);
    GS4I_BATCH_LOOP(b) {
        gs4i_wide_int cell[3];
        for (a = 0; a < 3; a++) {
            const gs4i_wide t = (x[a][b] - f->origin[a]) * f->inv_h - f->first[a];
            gs4i_wide safe, xi, lo, hi;
            GS4I_CHOOSE(safe, (t >= GS4I_C(1)) & (t < GS4I_C(GS4I_TILE - 1)), t, zero);
            GS4I_TRUNCATE(cell[a], safe);
            GS4I_TO_REAL(xi, cell[a]);
            xi = safe - xi - GS4I_C(0.5);
            lo = GS4I_C(0.5) - xi;
            hi = GS4I_C(0.5) + xi;
            s->xi[a][b] = xi;
            s->w[a][0][b] = GS4I_C(0.5) * (lo * lo);
            s->w[a][1][b] = GS4I_C(0.75) - xi * xi;
            s->w[a][2][b] = GS4I_C(0.5) * (hi * hi);
            s->d[a][0][b] = -f->inv_h * lo;
            s->d[a][1][b] = (-2 * f->inv_h) * xi;
            s->d[a][2][b] = f->inv_h * hi;
        }
        base = ((cell[2] - 1) * GS4I_TILE + (cell[1] - 1)) * GS4I_TILE + (cell[0] - 1);
        GS4I_CHOOSE_INT(base, (cell[0] > 0) & (cell[1] > 0) & (cell[2] > 0), base, 0 * base - 1);
        memcpy(s->base + GS4I_WIDTH * b, &base, sizeof base);
    }
}

/* tile += row by row  y_j z_k P0 + dy_j z_k P1 + y_j dz_k P2,  where the x-weights are in P0,
 * P1, P2 already. */
GS4I_INLINE void gs4i_scatter_rows(gs4_real *GS4I_RESTRICT at, const gs4i_row *p0,
                                   const gs4i_row *p1, const gs4i_row *p2, const gs4i_stencils *s,
                                   int n)
{
    int j, k;
    for (j = 0; j < 3; j++) {
        gs4i_row a, b;
        GS4I_ROW_SPLAT_MUL(a, GS4I_NTH_CONST(s->w[1][j], n), *p0);
        GS4I_ROW_SPLAT_MAD(a, GS4I_NTH_CONST(s->d[1][j], n), *p1);
        GS4I_ROW_SPLAT_MUL(b, GS4I_NTH_CONST(s->w[1][j], n), *p2);
        for (k = 0; k < 3; k++) {
            gs4_real *row = at + 4 * GS4I_TILE * (GS4I_TILE * k + j);
            gs4i_row r, t;
            GS4I_ROW_LOAD(r, row);
            GS4I_ROW_SPLAT_MUL(t, GS4I_NTH_CONST(s->w[2][k], n), a);
            GS4I_ROW_SPLAT_MAD(t, GS4I_NTH_CONST(s->d[2][k], n), b);
            GS4I_ROW_SUM(r, r, t);
            GS4I_ROW_STORE(row, r);
        }
    }
}

/* The three rows of one z: sums with the weights and with the derivatives along y */
GS4I_INLINE void gs4i_gather_plane(const gs4_real *at, const gs4i_stencils *s, int n,
                                   gs4i_row *plain, gs4i_row *slope)
{
    gs4i_row r;
    GS4I_ROW_LOAD(r, at);
    GS4I_ROW_SPLAT_MUL(*plain, GS4I_NTH_CONST(s->w[1][0], n), r);
    GS4I_ROW_SPLAT_MUL(*slope, GS4I_NTH_CONST(s->d[1][0], n), r);
    GS4I_ROW_LOAD(r, at + 4 * GS4I_TILE);
    GS4I_ROW_SPLAT_MAD(*plain, GS4I_NTH_CONST(s->w[1][1], n), r);
    GS4I_ROW_SPLAT_MAD(*slope, GS4I_NTH_CONST(s->d[1][1], n), r);
    GS4I_ROW_LOAD(r, at + 8 * GS4I_TILE);
    GS4I_ROW_SPLAT_MAD(*plain, GS4I_NTH_CONST(s->w[1][2], n), r);
    GS4I_ROW_SPLAT_MAD(*slope, GS4I_NTH_CONST(s->d[1][2], n), r);
}

/* What nodes give to a batch, four numbers a particle: value = sum w_i f_i of the four numbers f_i
 * of nodes. Columns of its gradient: dx = sum dw_i/dx f_i and so on. */
typedef struct gs4i_gathered {
    gs4_real value[4 * GS4I_BATCH], dx[4 * GS4I_BATCH], dy[4 * GS4I_BATCH], dz[4 * GS4I_BATCH];
} gs4i_gathered;

/* Forces of a batch on its way to the nodes: the columns of -V sigma, and m g; four numbers a
 * particle. */
typedef struct gs4i_forces {
    gs4_real x[4 * GS4I_BATCH], y[4 * GS4I_BATCH], z[4 * GS4I_BATCH], weight[4 * GS4I_BATCH];
} gs4i_forces;

/* For particle n; wx and dx: weights and derivatives along x, from gs4i_x_weights. */
GS4I_INLINE void gs4i_gather_local(const gs4_real *at, const gs4i_stencils *s, int n,
                                   const gs4i_row *wx, const gs4i_row *dx, gs4i_gathered *g)
{
    const int next = 4 * GS4I_TILE * GS4I_TILE;
    gs4i_row plain, slope, s0, s1, s2;
    gs4i_quad q;
    gs4i_gather_plane(at, s, n, &plain, &slope);
    GS4I_ROW_SPLAT_MUL(s0, GS4I_NTH_CONST(s->w[2][0], n), plain);
    GS4I_ROW_SPLAT_MUL(s1, GS4I_NTH_CONST(s->w[2][0], n), slope);
    GS4I_ROW_SPLAT_MUL(s2, GS4I_NTH_CONST(s->d[2][0], n), plain);
    gs4i_gather_plane(at + next, s, n, &plain, &slope);
    GS4I_ROW_SPLAT_MAD(s0, GS4I_NTH_CONST(s->w[2][1], n), plain);
    GS4I_ROW_SPLAT_MAD(s1, GS4I_NTH_CONST(s->w[2][1], n), slope);
    GS4I_ROW_SPLAT_MAD(s2, GS4I_NTH_CONST(s->d[2][1], n), plain);
    gs4i_gather_plane(at + 2 * next, s, n, &plain, &slope);
    GS4I_ROW_SPLAT_MAD(s0, GS4I_NTH_CONST(s->w[2][2], n), plain);
    GS4I_ROW_SPLAT_MAD(s1, GS4I_NTH_CONST(s->w[2][2], n), slope);
    GS4I_ROW_SPLAT_MAD(s2, GS4I_NTH_CONST(s->d[2][2], n), plain);
    gs4i_row_dot(&q, wx, &s0);
    GS4I_STORE(g->value + 4 * n, q);
    gs4i_row_dot(&q, dx, &s0);
    GS4I_STORE(g->dx + 4 * n, q);
    gs4i_row_dot(&q, wx, &s1);
    GS4I_STORE(g->dy + 4 * n, q);
    gs4i_row_dot(&q, wx, &s2);
    GS4I_STORE(g->dz + 4 * n, q);
}

/* sum w_i f_i without the gradient. */
GS4I_INLINE void gs4i_gather_value(const gs4_real *at, const gs4i_stencils *s, int n,
                                   const gs4i_row *wx, gs4_real value[4 * GS4I_BATCH])
{
    gs4i_row r, s0, t;
    gs4i_quad q;
    int j;
    for (j = 0; j < 3; j++, at += 4 * GS4I_TILE) {
        GS4I_ROW_LOAD(r, at);
        GS4I_ROW_SPLAT_MUL(t, GS4I_NTH_CONST(s->w[2][0], n), r);
        GS4I_ROW_LOAD(r, at + 4 * GS4I_TILE * GS4I_TILE);
        GS4I_ROW_SPLAT_MAD(t, GS4I_NTH_CONST(s->w[2][1], n), r);
        GS4I_ROW_LOAD(r, at + 8 * GS4I_TILE * GS4I_TILE);
        GS4I_ROW_SPLAT_MAD(t, GS4I_NTH_CONST(s->w[2][2], n), r);
        if (j == 0)
            GS4I_ROW_SPLAT_MUL(s0, GS4I_NTH_CONST(s->w[1][0], n), t);
        else
            GS4I_ROW_SPLAT_MAD(s0, GS4I_NTH_CONST(s->w[1][j], n), t);
    }
    gs4i_row_dot(&q, wx, &s0);
    GS4I_STORE(value + 4 * n, q);
}

/* The x-weights and x-derivatives of particle n, spread over rows. */
GS4I_INLINE void gs4i_x_weights(const gs4i_stencils *s, int n, gs4i_row *w, gs4i_row *d)
{
    gs4i_row_of_nodes(w, GS4I_NTH_CONST(s->w[0][0], n), GS4I_NTH_CONST(s->w[0][1], n),
                      GS4I_NTH_CONST(s->w[0][2], n));
    gs4i_row_of_nodes(d, GS4I_NTH_CONST(s->d[0][0], n), GS4I_NTH_CONST(s->d[0][1], n),
                      GS4I_NTH_CONST(s->d[0][2], n));
}

/* Velocity gradients of a batch from what was gathered: L[i][j] = dv_i/dx_j. */
typedef gs4i_lanes gs4i_gradient[3][3];

GS4I_INLINE void gs4i_gradient_lanes(const gs4_real *dx, const gs4_real *dy, const gs4_real *dz,
                                     int n, gs4i_gradient L)
{
    gs4i_lanes c[4];
    int i, j, b;
    for (j = 0; j < 3; j++) {
        gs4i_to_lanes(j == 0 ? dx : j == 1 ? dy : dz, n, c);
        for (i = 0; i < 3; i++)
            GS4I_BATCH_LOOP(b) L[i][j][b] = c[i][b];
    }
}

/* Nine numbers of any 3 x 3 matrix, row by row. */
typedef gs4i_gradient gs4i_matrix;

/* |L|^2 */
GS4I_INLINE void gs4i_gradient_squared(gs4i_gradient L, gs4i_lanes squared)
{
    int b, j;
    GS4I_BATCH_LOOP(b) {
        squared[b] = L[0][0][b] * L[0][0][b];
        for (j = 1; j < 9; j++) squared[b] += L[j / 3][j % 3][b] * L[j / 3][j % 3][b];
    }
}

/* ==== [[grid]] blocks of nodes where there is material ========================================= *
 *
 * Nodes -4 .. n+3 exist along each axis; the mirror nodes of the walls are those outside 0 .. n-1.
 * One number per block of the domain says where its nodes are. Only blocks within reach of
 * particles have any: time and memory follow the material, not the domain.
 *
 * A block with nodes has a slot. Node i of it, x fastest, is number 64 slot + i, and has four reals
 * of each field: (momentum, mass) -> (velocity, mass); (force, b) -> (acceleration, b / mass), b
 * the mass with deconvolution, else what the decay of J needs; for GS4 the acceleration ag that it
 * remembers from step to step; and a byte of flags.
 *
 * A block and its tile, the 8^3 nodes that its particles touch. They may be a cell outside of it:
 *
 *         -2  -1 | 0   1   2   3 | 4   5          o  nodes of the block (one layer of four)
 *      -2  .   . | .   .   .   . | .   .          .  nodes of its neighbours
 *      -1  .   . | .   .   .   . | .   .          w  reach of the particle x: 3 nodes an axis
 *         -------+---------------+-------
 *       0  .   . | o   w   w   w | .   .
 *       1  .   . | o   w   wx  w | .   .
 *       2  .   . | o   w   w   w | .   .
 *       3  .   . | o   o   o   o | .   .
 *         -------+---------------+-------
 *       4  .   . | .   .   .   . | .   .
 *       5  .   . | .   .   .   . | .   . */

#define GS4I_NODE_REALS (4 * GS4I_BLOCK_NODES)

/* Flags of a node. Those of the last step belong to the state; the others are made anew. */
enum {
    /* bit a: a mirror node of axis a whose wall is in contact; of the partitioned scheme: the
     * face of axis a remembers, which lasts as GS4I_REMEMBERS does */
    GS4I_FOLDS = 7,
    GS4I_PRESSED = 8, /* material presses on the wall there */
    GS4I_IMAGED = 16, /* image particles behind a sticky collider reach it */
    GS4I_LACKS_IMAGE =
        32,              /* a particle reaches it that is near a sticky collider and has no image */
    GS4I_REMEMBERS = 64, /* ag holds an acceleration */
    GS4I_WAS_PRESSED = 128,
    GS4I_LASTS = GS4I_REMEMBERS | GS4I_WAS_PRESSED
};

/* Where data lives on the grid of cells: a bit for each axis along which it is staggered by half
 * a cell to the low side. Bit patterns of one axis are faces, of two are edges. */
enum {
    GS4I_AT_CELL = 0,
    GS4I_AT_FACE_X = 1,
    GS4I_AT_FACE_Y = 2,
    GS4I_AT_FACE_Z = 4,
    GS4I_AT_EDGE_XY = 3,
    GS4I_AT_EDGE_XZ = 5,
    GS4I_AT_EDGE_YZ = 6
};

typedef struct gs4i_grid {
    /* domain in cells; table in blocks, one block more on every side */
    int cells[3], blocks[3];
    gs4_real h, inv_h;
    gs4_vec3 origin;
    int periodic[3];
    int32_t *table;
    size_t table_count; /* per block: 1 + its slot, 0: no nodes */
    /* blocks with nodes, ascending by number: slot s is block[s] */
    int active, capacity;
    /* per slot: its number; which occupied block it is, or -1 */
    uint32_t *block;
    int32_t *occupant;
    /* GS4I_NODE_REALS per slot: see gs4i_velocity, gs4i_acceleration; ag, NULL for Euler */
    gs4_real *momentum, *force, *remembered;
    uint8_t *flags; /* GS4I_BLOCK_NODES per slot, bits GS4I_FOLDS ... */
    /* blocks with particles, ascending */
    int occupied, occupied_capacity;
    uint32_t *occupied_block;
    /* per occupied block: its first particle; one more at the end */
    int32_t *first;
    /* per occupied block: slots of the 27 blocks around, x fastest */
    int32_t *neighbour;
    /* occupied blocks by parity of their coordinates: same colour, disjoint tiles */
    int32_t *by_colour;
    int colour_first[9];
    /* [[boundary]]: per slot, 1 + its place in `jump` */
    int32_t *jump_of;
    gs4_real *jump;
    int jump_count, jump_capacity;
    /* 4 a slot: mean velocity of its nodes, how far they are from it, see [[step]] */
    gs4_real *spread;
    int with_deconvolution; /* sharpened gradients: */
    /* a field sharpened; how full its nodes are, one number each: see gs4i_deconvolve_block */
    gs4_real *deconvolved, *fill_fraction;
    gs4i_scratch lists[2], histogram; /* of sorting */
} gs4i_grid;

/* Walls at the low ends belong to the domain, those at the high ends do not. */
GS4I_INLINE int gs4i_is_in_domain(const gs4i_grid *g, const gs4_real x[3])
{
    return x[0] >= g->origin.x && x[0] < g->origin.x + GS4I_C(g->cells[0]) * g->h
           && x[1] >= g->origin.y && x[1] < g->origin.y + GS4I_C(g->cells[1]) * g->h
           && x[2] >= g->origin.z && x[2] < g->origin.z + GS4I_C(g->cells[2]) * g->h;
}

GS4I_INLINE void gs4i_block_coordinates(const gs4i_grid *g, uint32_t block, int at[3])
{
    at[0] = (int)(block % (uint32_t)g->blocks[0]);
    at[1] = (int)(block / (uint32_t)g->blocks[0] % (uint32_t)g->blocks[1]);
    at[2] = (int)(block / (uint32_t)g->blocks[0] / (uint32_t)g->blocks[1]);
}

GS4I_INLINE uint32_t gs4i_block_number(const gs4i_grid *g, int x, int y, int z)
{
    return ((uint32_t)z * (uint32_t)g->blocks[1] + (uint32_t)y) * (uint32_t)g->blocks[0]
           + (uint32_t)x;
}

/* Block along an axis of cell or node x, from -4: the table begins a block before the domain. */
GS4I_INLINE int gs4i_block_at(int x) { return (x + 4) >> 2; }

/* Place of node (x, y, z) in its block; only the last two bits count. */
GS4I_INLINE int gs4i_place_of(int x, int y, int z) { return (z & 3) << 4 | (y & 3) << 2 | (x & 3); }

GS4I_INLINE int gs4i_slot_of(uint32_t node) { return (int)(node / GS4I_BLOCK_NODES); }
GS4I_INLINE uint32_t gs4i_first_node(int slot) { return (uint32_t)slot * GS4I_BLOCK_NODES; }

/* The four reals of a node. */
GS4I_INLINE gs4_real *gs4i_of_node(gs4_real *field, uint32_t node)
{
    return field + 4 * (size_t)node;
}

/* The nodes of a block. */
GS4I_INLINE gs4_real *gs4i_of_slot(gs4_real *field, int slot)
{
    return field + (size_t)GS4I_NODE_REALS * (size_t)slot;
}

/* Slot of block (x, y, z), -1: it has no nodes. */
GS4I_INLINE int gs4i_slot_of_block(const gs4i_grid *g, int x, int y, int z)
{
    if (x < 0 || y < 0 || z < 0 || x >= g->blocks[0] || y >= g->blocks[1] || z >= g->blocks[2])
        return -1;
    return g->table[gs4i_block_number(g, x, y, z)] - 1;
}

/* Number of node (x, y, z), each from -4 to n + 3; -1: it does not exist now. */
GS4I_INLINE int64_t gs4i_node_at(const gs4i_grid *g, int x, int y, int z)
{
    const int slot =
        g->table[gs4i_block_number(g, gs4i_block_at(x), gs4i_block_at(y), gs4i_block_at(z))] - 1;
    return slot < 0 ? -1 : (int64_t)gs4i_first_node(slot) + gs4i_place_of(x, y, z);
}

/* Coordinates of the first node of a block, in cells. */
GS4I_INLINE void gs4i_block_origin(const gs4i_grid *g, uint32_t block, int first[3])
{
    int a;
    gs4i_block_coordinates(g, block, first);
    for (a = 0; a < 3; a++) first[a] = 4 * first[a] - 4;
}

/* Coordinates of node i of the block that begins at `first`. */
GS4I_INLINE void gs4i_node_coordinates(const int first[3], int i, int x[3])
{
    x[0] = first[0] + (i & 3);
    x[1] = first[1] + (i >> 2 & 3);
    x[2] = first[2] + (i >> 4);
}

/* World position of the data of cell x that lives at `place`: of its centre, low face or edge. */
GS4I_INLINE gs4_vec3 gs4i_place_position(const gs4i_grid *g, const int x[3], int place)
{
    return gs4i_add(g->origin, gs4i_scale(gs4i_vec3(GS4I_C(x[0]) + GS4I_C(place & 1 ? 0 : 0.5),
                                                    GS4I_C(x[1]) + GS4I_C(place & 2 ? 0 : 0.5),
                                                    GS4I_C(x[2]) + GS4I_C(place & 4 ? 0 : 0.5)),
                                          g->h));
}

static gs4_vec3 gs4i_block_centre(const gs4i_grid *g, uint32_t block)
{
    int first[3];
    gs4i_block_origin(g, block, first);
    return gs4i_add(g->origin, gs4i_scale(gs4i_vec3(GS4I_C(first[0] + 2), GS4I_C(first[1] + 2),
                                                    GS4I_C(first[2] + 2)),
                                          g->h));
}

/* Slot of the block that p is in, -1: it has no nodes. */
static int gs4i_slot_at(const gs4i_grid *g, const gs4_real p[3])
{
    const gs4_real origin[3] = { g->origin.x, g->origin.y, g->origin.z };
    int at[3], a;
    for (a = 0; a < 3; a++) {
        const gs4_real t = (p[a] - origin[a]) * g->inv_h + 4;
        if (!(t >= 0 && t < GS4I_C(g->cells[a]) + 8)) return -1;
        at[a] = gs4i_block_at((int)t - 4);
    }
    return gs4i_slot_of_block(g, at[0], at[1], at[2]);
}

/* The tile of a block, for the kernels: it begins two nodes before the block. */
GS4I_INLINE gs4i_frame gs4i_tile_frame(const gs4i_grid *g, uint32_t block)
{
    gs4i_frame f;
    int first[3], a;
    gs4i_block_origin(g, block, first);
    for (a = 0; a < 3; a++) f.first[a] = GS4I_C(first[a] - 2);
    f.origin[0] = g->origin.x;
    f.origin[1] = g->origin.y;
    f.origin[2] = g->origin.z;
    f.inv_h = g->inv_h;
    return f;
}

/* Does the tile of occupied block o reach over the edge of the domain? */
static int gs4i_at_edge(const gs4i_grid *g, int o)
{
    int first[3], a, edge = 0;
    gs4i_block_origin(g, g->occupied_block[o], first);
    for (a = 0; a < 3; a++) edge |= first[a] == 0 || first[a] + 6 > g->cells[a];
    return edge;
}

/* Fields of a step by what they hold at its stages; what is scattered is made into it in place:
 * momentum into velocity when S3 ends, force into acceleration in S6. */
GS4I_INLINE gs4_real *gs4i_velocity(const gs4i_grid *g) { return g->momentum; }
GS4I_INLINE gs4_real *gs4i_acceleration(const gs4i_grid *g) { return g->force; }

/* The velocity whose gradients particles see. */
GS4I_INLINE gs4_real *gs4i_gradient_velocity(const gs4i_grid *g)
{
    return g->with_deconvolution ? g->deconvolved : g->momentum;
}

/* Velocity jumps by contact exist in blocks near walls and colliders: see [[boundary]]. */
GS4I_INLINE int gs4i_has_jumps(const gs4i_grid *g, int slot) { return g->jump_of[slot] > 0; }

/* Jumps of the nodes of a block, NULL: it has none. */
GS4I_INLINE gs4_real *gs4i_jumps_of(const gs4i_grid *g, int slot)
{
    return g->jump_of[slot] ? gs4i_of_slot(g->jump, g->jump_of[slot] - 1) : NULL;
}

GS4I_INLINE gs4_real *gs4i_jump_of_node(const gs4i_grid *g, uint32_t node)
{
    return gs4i_jumps_of(g, gs4i_slot_of(node)) + 4 * (node % GS4I_BLOCK_NODES);
}

/* Has any block that the tile of occupied block o reaches jumps? */
static int gs4i_jumps_are_near(const gs4i_grid *g, int o)
{
    int i, any = 0;
    for (i = 0; i < 27; i++) any |= g->jump_of[g->neighbour[27 * (size_t)o + (size_t)i]];
    return any != 0;
}

/* Block that holds the particles of cell (x, y, z). Cells beyond the domain belong to the
 * nearest one inside. */
GS4I_INLINE uint32_t gs4i_home_block(const gs4i_grid *g, const int cell[3])
{
    int at[3], a;
    for (a = 0; a < 3; a++) {
        int c = cell[a] < 0 ? 0 : cell[a] >= g->cells[a] ? g->cells[a] - 1 : cell[a];
        at[a] = gs4i_block_at(c);
    }
    return gs4i_block_number(g, at[0], at[1], at[2]);
}

static void gs4i_grid_free(gs4i_memory *m, gs4i_grid *g)
{
    size_t c = (size_t)g->capacity, o = (size_t)g->occupied_capacity;
    gs4i_free(m, g->table, g->table_count, sizeof *g->table);
    gs4i_free(m, g->block, c, sizeof *g->block);
    gs4i_free(m, g->occupant, c, sizeof *g->occupant);
    gs4i_free(m, g->jump_of, c, sizeof *g->jump_of);
    gs4i_free(m, g->spread, c, 4 * sizeof *g->spread);
    gs4i_free(m, g->momentum, c, GS4I_NODE_REALS * sizeof(gs4_real));
    gs4i_free(m, g->force, c, GS4I_NODE_REALS * sizeof(gs4_real));
    gs4i_free(m, g->remembered, c, GS4I_NODE_REALS * sizeof(gs4_real));
    gs4i_free(m, g->deconvolved, c, GS4I_NODE_REALS * sizeof(gs4_real));
    gs4i_free(m, g->fill_fraction, c, GS4I_BLOCK_NODES * sizeof(gs4_real));
    gs4i_free(m, g->occupied_block, o, sizeof *g->occupied_block);
    gs4i_free(m, g->first, o + 1, sizeof *g->first);
    gs4i_free(m, g->neighbour, o, 27 * sizeof *g->neighbour);
    gs4i_free(m, g->by_colour, o, sizeof *g->by_colour);
    gs4i_free(m, g->jump, (size_t)g->jump_capacity, GS4I_NODE_REALS * sizeof(gs4_real));
    gs4i_free(m, g->flags, c, GS4I_BLOCK_NODES);
    gs4i_free(m, g->lists[0].data, g->lists[0].bytes, 1);
    gs4i_free(m, g->lists[1].data, g->lists[1].bytes, 1);
    gs4i_free(m, g->histogram.data, g->histogram.bytes, 1);
}

/* Room for `count` blocks with nodes; the old ones stay. All or nothing. */
static int gs4i_grid_reserve(gs4i_memory *m, gs4i_grid *g, int count, int with_remembered)
{
    gs4i_grid n = *g;
    size_t c, old = (size_t)g->capacity, keep = (size_t)g->active,
              node = GS4I_NODE_REALS * sizeof(gs4_real), one = GS4I_BLOCK_NODES * sizeof(gs4_real);
    if (count <= g->capacity) return GS4_OK;
    n.capacity = count + count / 16;
    c = (size_t)n.capacity;
    n.block = (uint32_t *)gs4i_alloc(m, c, sizeof *n.block);
    n.occupant = (int32_t *)gs4i_alloc(m, c, sizeof *n.occupant);
    n.jump_of = (int32_t *)gs4i_alloc(m, c, sizeof *n.jump_of);
    n.spread = (gs4_real *)gs4i_alloc(m, c, 4 * sizeof *n.spread);
    n.momentum = (gs4_real *)gs4i_alloc(m, c, node);
    n.force = (gs4_real *)gs4i_alloc(m, c, node);
    n.flags = (uint8_t *)gs4i_alloc(m, c, GS4I_BLOCK_NODES);
    n.remembered = with_remembered ? (gs4_real *)gs4i_alloc(m, c, node) : NULL;
    n.deconvolved = g->with_deconvolution ? (gs4_real *)gs4i_alloc(m, c, node) : NULL;
    n.fill_fraction = g->with_deconvolution ? (gs4_real *)gs4i_alloc(m, c, one) : NULL;
    if (!n.block || !n.occupant || !n.jump_of || !n.spread || !n.momentum || !n.force || !n.flags
        || (with_remembered && !n.remembered)
        || (g->with_deconvolution && (!n.deconvolved || !n.fill_fraction))) {
        gs4i_free(m, n.block, c, sizeof *n.block);
        gs4i_free(m, n.occupant, c, sizeof *n.occupant);
        gs4i_free(m, n.jump_of, c, sizeof *n.jump_of);
        gs4i_free(m, n.spread, c, 4 * sizeof *n.spread);
        gs4i_free(m, n.momentum, c, node);
        gs4i_free(m, n.force, c, node);
        gs4i_free(m, n.remembered, c, node);
        gs4i_free(m, n.deconvolved, c, node);
        gs4i_free(m, n.fill_fraction, c, one);
        gs4i_free(m, n.flags, c, GS4I_BLOCK_NODES);
        return GS4_ERROR_MEMORY;
    }
    if (g->block) memcpy(n.block, g->block, keep * sizeof *n.block);
    if (g->flags) memcpy(n.flags, g->flags, keep * GS4I_BLOCK_NODES);
    if (g->remembered) memcpy(n.remembered, g->remembered, keep * node);
    gs4i_free(m, g->block, old, sizeof *g->block);
    gs4i_free(m, g->occupant, old, sizeof *g->occupant);
    gs4i_free(m, g->jump_of, old, sizeof *g->jump_of);
    gs4i_free(m, g->spread, old, 4 * sizeof *g->spread);
    gs4i_free(m, g->momentum, old, node);
    gs4i_free(m, g->force, old, node);
    gs4i_free(m, g->remembered, old, node);
    gs4i_free(m, g->deconvolved, old, node);
    gs4i_free(m, g->fill_fraction, old, one);
    gs4i_free(m, g->flags, old, GS4I_BLOCK_NODES);
    *g = n;
    return GS4_OK;
}

/* Room for `count` blocks with particles; the list of their numbers stays. All or nothing. */
static int gs4i_grid_reserve_occupied(gs4i_memory *m, gs4i_grid *g, int count)
{
    size_t c, old = (size_t)g->occupied_capacity;
    uint32_t *block;
    int32_t *first, *neighbour, *by_colour;
    if (count <= g->occupied_capacity) return GS4_OK;
    c = (size_t)count + (size_t)count / 4 + 64;
    block = (uint32_t *)gs4i_alloc(m, c, sizeof *block);
    first = (int32_t *)gs4i_alloc(m, c + 1, sizeof *first);
    neighbour = (int32_t *)gs4i_alloc(m, c, 27 * sizeof *neighbour);
    by_colour = (int32_t *)gs4i_alloc(m, c, sizeof *by_colour);
    if (!block || !first || !neighbour || !by_colour) {
        gs4i_free(m, block, c, sizeof *block);
        gs4i_free(m, first, c + 1, sizeof *first);
        gs4i_free(m, neighbour, c, 27 * sizeof *neighbour);
        gs4i_free(m, by_colour, c, sizeof *by_colour);
        return GS4_ERROR_MEMORY;
    }
    if (g->occupied_block) {
        memcpy(block, g->occupied_block, old * sizeof *block);
        memcpy(first, g->first, (old + 1) * sizeof *first);
        memcpy(neighbour, g->neighbour, old * 27 * sizeof *neighbour);
        memcpy(by_colour, g->by_colour, old * sizeof *by_colour);
    }
    gs4i_free(m, g->occupied_block, old, sizeof *block);
    gs4i_free(m, g->first, old + 1, sizeof *first);
    gs4i_free(m, g->neighbour, old, 27 * sizeof *neighbour);
    gs4i_free(m, g->by_colour, old, sizeof *by_colour);
    g->occupied_block = block;
    g->first = first;
    g->neighbour = neighbour;
    g->by_colour = by_colour;
    g->occupied_capacity = (int)c;
    return GS4_OK;
}

/* Blocks along one axis that tiles of block `b` reach, those behind a periodic wall included; at
 * most 6. */
static int gs4i_axis_reach(const gs4i_grid *g, int axis, int b, int out[6])
{
    int n = 0, n_cells = g->cells[axis], i;
    for (i = -1; i <= 1; i++) out[n++] = b + i;
    if (g->periodic[axis]) {
        int first = 4 * (b - 1) - 2, node; /* tile nodes first .. first + 7 */
        for (node = first; node < first + GS4I_TILE; node++) {
            int wrapped = node < 0          ? node + n_cells
                          : node >= n_cells ? node - n_cells
                                            : node,
                at = gs4i_block_at(wrapped);
            if (wrapped == node) continue;
            for (i = 0; i < n && out[i] != at; i++) {
            }
            if (i == n && n < 6) out[n++] = at;
        }
    }
    return n;
}

/* mark in the table while lists are made; slots stay below it */
#define GS4I_SEEN 0x40000000

/* Does any node of this slot remember something? */
static int gs4i_slot_remembers(const gs4i_grid *g, int slot)
{
    const uint8_t *flags = g->flags + gs4i_first_node(slot);
    int i, any = 0;
    for (i = 0; i < GS4I_BLOCK_NODES; i++) any |= flags[i] & GS4I_LASTS;
    return any != 0;
}

/* Make the list of blocks that need nodes in lists[1]: all that the occupied ones reach, and
 * those that remember something, so that a step which sorts and is refused then forgets nothing.
 * Returns how many, or an error. */
static int gs4i_grid_collect(gs4i_memory *m, gs4i_grid *g, const uint32_t *occupied, int count)
{
    uint32_t *list = (uint32_t *)g->lists[1].data;
    int o, n = 0, result = GS4_OK;
    for (o = 0; o < count && result == GS4_OK; o++) {
        int at[3], rx[6], ry[6], rz[6], nx, ny, nz, i, j, k;
        gs4i_block_coordinates(g, occupied[o], at);
        nx = gs4i_axis_reach(g, 0, at[0], rx);
        ny = gs4i_axis_reach(g, 1, at[1], ry);
        nz = gs4i_axis_reach(g, 2, at[2], rz);
        list = (uint32_t *)gs4i_scratch_reserve(
            m, &g->lists[1], (size_t)(n + nx * ny * nz) * sizeof *list, (size_t)n * sizeof *list);
        if (!list) {
            list = (uint32_t *)g->lists[1].data;
            result = GS4_ERROR_MEMORY;
            break;
        }
        for (k = 0; k < nz; k++)
            for (j = 0; j < ny; j++)
                for (i = 0; i < nx; i++) {
                    uint32_t b = gs4i_block_number(g, rx[i], ry[j], rz[k]);
                    if (g->table[b] & GS4I_SEEN) continue;
                    g->table[b] |= GS4I_SEEN;
                    list[n++] = b;
                }
    }
    for (o = 0; g->remembered && o < g->active && result == GS4_OK; o++) {
        if ((g->table[g->block[o]] & GS4I_SEEN) || !gs4i_slot_remembers(g, o)) continue;
        list = (uint32_t *)gs4i_scratch_reserve(m, &g->lists[1], (size_t)(n + 1) * sizeof *list,
                                                (size_t)n * sizeof *list);
        if (!list) {
            list = (uint32_t *)g->lists[1].data;
            result = GS4_ERROR_MEMORY;
            break;
        }
        g->table[g->block[o]] |= GS4I_SEEN;
        list[n++] = g->block[o];
    }
    for (o = 0; o < n; o++) g->table[list[o]] &= ~GS4I_SEEN;
    return result == GS4_OK ? n : result;
}

/* Blocks of one colour have no node in common. */
static int gs4i_block_colour(const gs4i_grid *g, uint32_t block)
{
    int at[3];
    gs4i_block_coordinates(g, block, at);
    return (at[0] & 1) | (at[1] & 1) << 1 | (at[2] & 1) << 2;
}

static void gs4i_grid_link(gs4i_grid *g)
{
    int o, s, i, j, k, colour, n = 0;
    for (s = 0; s < g->active; s++) g->occupant[s] = -1;
    for (o = 0; o < g->occupied; o++) {
        int at[3], slot = 0;
        gs4i_block_coordinates(g, g->occupied_block[o], at);
        for (k = -1; k <= 1; k++)
            for (j = -1; j <= 1; j++)
                for (i = -1; i <= 1; i++)
                    g->neighbour[27 * (size_t)o + (size_t)slot++] =
                        g->table[gs4i_block_number(g, at[0] + i, at[1] + j, at[2] + k)] - 1;
        g->occupant[g->neighbour[27 * (size_t)o + 13]] = o;
    }
    for (colour = 0; colour < 8; colour++) {
        g->colour_first[colour] = n;
        for (o = 0; o < g->occupied; o++)
            if (gs4i_block_colour(g, g->occupied_block[o]) == colour) g->by_colour[n++] = o;
    }
    g->colour_first[8] = n;
}

/* Have all blocks around the occupied ones, and those they reach behind periodic walls, nodes? */
static int gs4i_grid_is_complete(const gs4i_grid *g)
{
    int o, i, j, k;
    for (o = 0; o < g->occupied; o++) {
        int at[3], rx[6], ry[6], rz[6], nx, ny, nz;
        gs4i_block_coordinates(g, g->occupied_block[o], at);
        nx = gs4i_axis_reach(g, 0, at[0], rx);
        ny = gs4i_axis_reach(g, 1, at[1], ry);
        nz = gs4i_axis_reach(g, 2, at[2], rz);
        for (k = 0; k < nz; k++)
            for (j = 0; j < ny; j++)
                for (i = 0; i < nx; i++)
                    if (!g->table[gs4i_block_number(g, rx[i], ry[j], rz[k])]) return 0;
    }
    return 1;
}

/* What nodes remember, moved to the slots of the n blocks of `list`. Between steps `force` and
 * `momentum` are free: they take the new order. */
static void gs4i_grid_carry(gs4i_grid *g, const uint32_t *list, int n, int with_remembered)
{
    uint8_t *flags = (uint8_t *)g->momentum;
    gs4_real *before = g->remembered;
    int s;
    for (s = 0; s < n; s++) {
        const int old = g->table[list[s]] - 1;
        uint8_t *to = flags + gs4i_first_node(s);
        if (old >= 0)
            memcpy(to, g->flags + gs4i_first_node(old), GS4I_BLOCK_NODES);
        else
            memset(to, 0, GS4I_BLOCK_NODES);
        if (!with_remembered) continue;
        if (old >= 0)
            memcpy(gs4i_of_slot(g->force, s), gs4i_of_slot(before, old),
                   GS4I_NODE_REALS * sizeof(gs4_real));
        else
            memset(gs4i_of_slot(g->force, s), 0, GS4I_NODE_REALS * sizeof(gs4_real));
    }
    memcpy(g->flags, flags, (size_t)n * GS4I_BLOCK_NODES);
    if (!with_remembered) return;
    g->remembered = g->force;
    g->force = before;
}

/* Give nodes to the occupied blocks and all within their reach; what nodes remember moves with
 * them. `occupied` ascending. Nothing changes when memory is refused. */
static int gs4i_grid_occupy(gs4i_memory *m, gs4i_grid *g, const uint32_t *occupied, int count,
                            int with_remembered)
{
    uint32_t *list;
    int n = gs4i_grid_collect(m, g, occupied, count), s;
    if (n < 0) return n;
    if (gs4i_grid_reserve(m, g, n, with_remembered) != GS4_OK
        || gs4i_grid_reserve_occupied(m, g, count) != GS4_OK)
        return GS4_ERROR_MEMORY;
    list = (uint32_t *)g->lists[1].data;
    gs4i_sort(list, n);
    gs4i_grid_carry(g, list, n, with_remembered);
    for (s = 0; s < g->active; s++) g->table[g->block[s]] = 0;
    for (s = 0; s < n; s++) {
        g->table[list[s]] = s + 1;
        g->block[s] = list[s];
    }
    g->active = n;
    memmove(g->occupied_block, occupied, (size_t)count * sizeof *occupied);
    g->occupied = count;
    gs4i_grid_link(g);
    return GS4_OK;
}

/* Where row (y, z) of the tile of occupied block o continues in the blocks left, of it and
 * right. */
GS4I_INLINE void gs4i_tile_row(const gs4i_grid *g, int o, int y, int z, ptrdiff_t at[3])
{
    const int32_t *nb = g->neighbour + 27 * (size_t)o;
    const int by = (y + 2) >> 2, bz = (z + 2) >> 2, row = 4 * gs4i_place_of(0, y + 2, z + 2);
    int i;
    for (i = 0; i < 3; i++) at[i] = (ptrdiff_t)nb[(bz * 3 + by) * 3 + i] * GS4I_NODE_REALS + row;
}

/* Rows of a tile that particles touch, a bit each: row (y, z) is bit 8 z + y. */
GS4I_INLINE uint64_t gs4i_touched_rows(int base)
{
    return (uint64_t)0x070707u << (base / GS4I_TILE);
}

/* Ask for two rows of nodes of a tile before they are needed: a few with each batch of
 * particles, because rows are scattered, no processor foresees them, and all at once are more
 * than one can wait for. */
GS4I_INLINE void gs4i_tile_prefetch(const gs4i_grid *g, int o, int row, const gs4_real *field)
{
    int end = row + 2;
    for (; row < end && row < 64; row++) {
        ptrdiff_t at[3];
        gs4i_tile_row(g, o, row & 7, row >> 3, at);
        GS4I_PREFETCH(field + at[0] + 8);
        GS4I_PREFETCH(field + at[1]);
        GS4I_PREFETCH(field + at[2]);
    }
}

/* The touched rows of a field into a tile, and the row behind each, because reads may run a node
 * over the end. */
static void gs4i_tile_load(const gs4i_grid *g, int o, uint64_t rows,
                           const gs4_real *GS4I_RESTRICT field, gs4_real *GS4I_RESTRICT tile)
{
    int row;
    rows |= rows << 1;
    for (row = 0; row < 64; row++, tile += 4 * GS4I_TILE) {
        ptrdiff_t at[3];
        if (!(rows >> row & 1)) continue;
        gs4i_tile_row(g, o, row & 7, row >> 3, at);
        memcpy(tile, field + at[0] + 8, 8 * sizeof(gs4_real));
        memcpy(tile + 8, field + at[1], 16 * sizeof(gs4_real));
        memcpy(tile + 24, field + at[2], 8 * sizeof(gs4_real));
    }
    memset(tile, 0, 16 * sizeof(gs4_real));
}

static void gs4i_tile_add(const gs4i_grid *g, int o, uint64_t rows,
                          const gs4_real *GS4I_RESTRICT tile, gs4_real *GS4I_RESTRICT field)
{
    int row, i;
    for (row = 0; row < 64; row++, tile += 4 * GS4I_TILE) {
        ptrdiff_t at[3];
        if (!(rows >> row & 1)) continue;
        gs4i_tile_row(g, o, row & 7, row >> 3, at);
        for (i = 0; i < GS4I_TILE; i++) {
            gs4_real *to = field
                           + (i < 2   ? at[0] + 8 + 4 * i
                              : i < 6 ? at[1] + 4 * (i - 2)
                                      : at[2] + 4 * (i - 6));
            gs4i_quad sum, q;
            GS4I_LOAD(sum, to);
            GS4I_LOAD(q, tile + 4 * i);
            GS4I_SUM(sum, sum, q);
            GS4I_STORE(to, sum);
        }
    }
}

/* --- the tile of any slot, whether its blocks have nodes or not ------------------------------- */

/* Slots of the 27 blocks around a slot, -1 where there are no nodes; and the frame of its tile. */
typedef struct gs4i_surroundings {
    int slot[27];
    gs4i_frame frame;
} gs4i_surroundings;

static void gs4i_surroundings_of(const gs4i_grid *g, int slot, gs4i_surroundings *t)
{
    int at[3], i;
    gs4i_block_coordinates(g, g->block[slot], at);
    for (i = 0; i < 27; i++)
        t->slot[i] =
            gs4i_slot_of_block(g, at[0] + i % 3 - 1, at[1] + i / 3 % 3 - 1, at[2] + i / 9 - 1);
    t->frame = gs4i_tile_frame(g, g->block[slot]);
}

/* Number of node (x, y, z) of a tile, -1 where it does not exist. */
GS4I_INLINE int64_t gs4i_surrounding_node(const gs4i_surroundings *t, int x, int y, int z)
{
    const int slot = t->slot[(((z + 2) >> 2) * 3 + ((y + 2) >> 2)) * 3 + ((x + 2) >> 2)];
    return slot < 0 ? -1 : (int64_t)gs4i_first_node(slot) + gs4i_place_of(x + 2, y + 2, z + 2);
}

/* --- sharpened gradients -------------------------------------------------------------------------
 *
 * Each of the four transfers of a step sees 1 - (k h)^2/8 of a wave exp(ikx). S v = v - sum_a
 * share_a D_a v, D_a the second difference along axis a, gives that back: gradients are those of
 * S v, and forces of stress go through the transpose of S, so that stress gives to motion what
 * it takes from it. D_a of a linear field is 0: momentum, spin and uniform strain stay what
 * they are. share_a is the least `full` of the three nodes of D_a: 1/4 where they are filled to
 * 80 % (by mass, of the densest material), 0 where one is to less than 40 %, smooth between. */

/* What a node that holds so much of what it can hold allows. */
GS4I_INLINE gs4_real gs4i_deconvolution_weight(gs4_real filled)
{
    const gs4_real t = gs4i_max(0, gs4i_min(1, (filled - GS4I_C(0.4)) * GS4I_C(2.5)));
    return GS4I_C(0.25) * t * t * (3 - 2 * t);
}

/* Eight nodes in a row along an axis: two of the block before (its slot, or -1), four of slot s,
 * two of the block behind. */
GS4I_INLINE void gs4i_line_of_nodes(const gs4i_grid *g, int s, const int side[2], int node,
                                    int apart, const gs4_real *from, gs4_real fill_fraction[8],
                                    gs4i_quad v[8])
{
    int i;
    for (i = 0; i < 8; i++) {
        const int slot = i < 2 ? side[0] : i < 6 ? s : side[1];
        const size_t at =
            (size_t)GS4I_BLOCK_NODES * (size_t)slot + (size_t)(node + ((i + 2) & 3) * apart);
        const gs4i_quad none = { GS4I_LANES(0, 0, 0, 0) };
        v[i] = none;
        fill_fraction[i] = 0;
        if (slot >= 0) {
            fill_fraction[i] = g->fill_fraction[at];
            GS4I_LOAD(v[i], from + 4 * at);
        }
    }
}

/* sharp = S from, or its transpose, on the nodes of a slot; fourth numbers are copied. */
static void gs4i_deconvolve_block(const gs4i_grid *g, int s, const gs4_real *from, int transposed)
{
    gs4_real *to = g->deconvolved + (size_t)GS4I_NODE_REALS * (size_t)s, most = 0;
    int at[3], a, line, i;
    memcpy(to, from + (size_t)GS4I_NODE_REALS * (size_t)s, GS4I_NODE_REALS * sizeof *to);
    for (i = 0; i < GS4I_BLOCK_NODES; i++)
        most = gs4i_max(most, g->fill_fraction[(size_t)GS4I_BLOCK_NODES * (size_t)s + (size_t)i]);
    if (!(most > 0)) return;
    gs4i_block_coordinates(g, g->block[s], at);
    for (a = 0; a < 3; a++) {
        const int apart = 1 << 2 * a, jump = a == 0   ? 1
                                             : a == 1 ? g->blocks[0]
                                                      : g->blocks[0] * g->blocks[1];
        int side[2];
        for (i = 0; i < 2; i++)
            side[i] = (i ? at[a] + 1 < g->blocks[a] : at[a] > 0)
                          ? g->table[(int)g->block[s] + (i ? jump : -jump)] - 1
                          : -1;
        for (line = 0; line < 16; line++) {
            const int node = (line / apart * 4 * apart) + line % apart;
            gs4_real fill_fraction[8], share[8];
            gs4i_quad v[8], d, own;
            gs4i_line_of_nodes(g, s, side, node, apart, from, fill_fraction, v);
            for (i = 1; i < 7; i++)
                share[i] = gs4i_min(fill_fraction[i],
                                    gs4i_min(fill_fraction[i - 1], fill_fraction[i + 1]));
            for (i = 1; i < 7 && transposed; i++) GS4I_SPLAT_MUL(v[i], share[i], v[i]);
            for (i = 2; i < 6; i++) {
                gs4_real *x = to + 4 * (node + (i - 2) * apart);
                const gs4_real w = transposed ? GS4I_C(-1) : -share[i];
                const gs4i_quad some = { GS4I_LANES(w, w, w, 0) };
                GS4I_SUM(d, v[i - 1], v[i + 1]);
                GS4I_SPLAT_MAD(d, GS4I_C(-2), v[i]);
                GS4I_LOAD(own, x);
                GS4I_MAD(own, some, d);
                GS4I_STORE(x, own);
            }
        }
    }
}

/* ==== [[box]] a dense box of cells around the material ========================================= *
 *
 * What solves work on: every cell of a box around the blocks with nodes, x fastest, with or
 * without material. Cell c has its centre at a node of [[grid]], `low` says at which. Numbers are
 * at cells, faces or edges; a place is a number with a bit for each axis along which it lies
 * half a cell lower: cells 0, faces 1 2 4, edges 3 5 6. Along such an axis there is one entry
 * more than cells; entry i is on the low side of cell i:
 *
 *          + 0 - + 1 - + 2             o  cells, place 0          y
 *          0  o  1  o  2               01 faces across x, 1       |
 *          + 0 - + 1 - + 2             -  faces across y, 2       +-- x
 *          0  o  1  o  2               +  edges along z, 3
 *          + 0 - + 1 - + 2
 *
 * Along a periodic axis the box is as long as the domain, its first and last faces are the same.
 * Fields are taken from one piece of memory, which grows and is kept from step to step. Loops
 * are by planes of constant z, a task each: sums over a plane have an order. */

typedef struct gs4i_box {
    int low[3], size[3];  /* node at the first cell; cells along each axis */
    int begin[3], end[3]; /* nodes that may have material, those behind open walls included */
    int periodic[3];      /* 1 or 0 */
    uint8_t wall[6];      /* sides of the domain with a wall that mirrors */
    size_t room;          /* entries of a field: at least those of any place */
    size_t bytes, taken;  /* of an entry of all fields; of those that are taken */
    char *fields;
} gs4i_box;

/* Bounds of the blocks with nodes and `margin` cells more, cut off at walls. */
static void gs4i_box_fit(gs4i_box *box, const gs4i_grid *g, const gs4_wall walls[6], int margin)
{
    int a, s, high[3];
    for (a = 0; a < 6; a++) box->wall[a] = walls[a] != GS4_WALL_OPEN && !g->periodic[a / 2];
    for (a = 0; a < 3; a++) {
        box->periodic[a] = g->periodic[a];
        box->begin[a] = walls[2 * a] == GS4_WALL_OPEN ? -GS4I_BLOCK_SIDE : 0;
        box->end[a] = g->cells[a] + (walls[2 * a + 1] == GS4_WALL_OPEN ? GS4I_BLOCK_SIDE : 0);
        box->low[a] = box->end[a];
        high[a] = box->begin[a];
    }
    for (s = 0; s < g->active; s++) {
        int first[3];
        gs4i_block_origin(g, g->block[s], first);
        for (a = 0; a < 3; a++) {
            if (first[a] - margin < box->low[a]) box->low[a] = first[a] - margin;
            if (first[a] + GS4I_BLOCK_SIDE + margin > high[a])
                high[a] = first[a] + GS4I_BLOCK_SIDE + margin;
        }
    }
    for (a = 0; a < 3; a++) {
        if (box->low[a] < box->begin[a] || g->periodic[a]) box->low[a] = box->begin[a];
        if (high[a] > box->end[a] || g->periodic[a]) high[a] = box->end[a];
        box->size[a] = high[a] - box->low[a];
    }
}

/* Room for fields that have `bytes` an entry in all; what was taken before is gone. */
static int gs4i_box_reserve(gs4i_memory *m, gs4i_box *box, size_t bytes)
{
    const size_t entries =
        ((size_t)box->size[0] + 1) * ((size_t)box->size[1] + 1) * ((size_t)box->size[2] + 1);
    box->taken = 0;
    if (entries > box->room || bytes > box->bytes) {
        const size_t room = (entries + entries / 8 + 63) / 64 * 64; /* all fields are aligned */
        char *fields = (char *)gs4i_alloc(m, room, bytes);
        if (!fields) return GS4_ERROR_MEMORY;
        gs4i_free(m, box->fields, box->room, box->bytes);
        box->fields = fields;
        box->room = room;
        box->bytes = bytes;
    }
    return GS4_OK;
}

/* The next field, of `size` bytes an entry; take those with the largest first. Not cleared. */
static void *gs4i_box_take(gs4i_box *box, size_t size)
{
    void *field = box->fields + box->taken * box->room;
    box->taken += size;
    return field;
}

static void gs4i_box_free(gs4i_memory *m, gs4i_box *box)
{
    gs4i_free(m, box->fields, box->room, box->bytes);
}

/* Entries of a place along an axis; in all. */
GS4I_INLINE int gs4i_box_length(const gs4i_box *box, int place, int axis)
{
    return box->size[axis] + (place >> axis & 1);
}
static size_t gs4i_box_count(const gs4i_box *box, int place)
{
    return (size_t)gs4i_box_length(box, place, 0) * (size_t)gs4i_box_length(box, place, 1)
           * (size_t)gs4i_box_length(box, place, 2);
}

GS4I_INLINE size_t gs4i_box_index(const gs4i_box *box, int place, int x, int y, int z)
{
    return ((size_t)z * (size_t)gs4i_box_length(box, place, 1) + (size_t)y)
               * (size_t)gs4i_box_length(box, place, 0)
           + (size_t)x;
}

/* All entries i, at at[], of a place in the plane z. */
#define GS4I_BOX_PLANE(box, place, z, at, i)                              \
    for (at[2] = (z), at[1] = 0, i = gs4i_box_index(box, place, 0, 0, z); \
         at[1] < gs4i_box_length(box, place, 1); at[1]++)                 \
        for (at[0] = 0; at[0] < gs4i_box_length(box, place, 0); at[0]++, i++)

/* The cell at a node, and its coordinates in the box; 0 if it is outside. What copies numbers of
 * nodes to cells and back goes through all nodes so. */
GS4I_INLINE int gs4i_box_cell_at(const gs4i_box *box, const int node[3], int at[3], size_t *cell)
{
    int a;
    for (a = 0; a < 3; a++) {
        at[a] = node[a] - box->low[a];
        if (at[a] < 0 || at[a] >= box->size[a]) return 0;
    }
    *cell = gs4i_box_index(box, GS4I_AT_CELL, at[0], at[1], at[2]);
    return 1;
}

/* Faces of a cell, each among those of its axis, in the order of gs4_sim_desc's walls. */
GS4I_INLINE void gs4i_box_faces_of(const gs4i_box *box, const int at[3], size_t face[6])
{
    const size_t row = (size_t)box->size[0], plane = row * (size_t)box->size[1];
    face[0] = gs4i_box_index(box, GS4I_AT_FACE_X, at[0], at[1], at[2]);
    face[1] = face[0] + 1;
    face[2] = gs4i_box_index(box, GS4I_AT_FACE_Y, at[0], at[1], at[2]);
    face[3] = face[2] + row;
    face[4] = gs4i_box_index(box, GS4I_AT_FACE_Z, at[0], at[1], at[2]);
    face[5] = face[4] + plane;
}

/* Whether the cell touches a wall of the domain on this side. */
GS4I_INLINE int gs4i_box_at_wall(const gs4i_box *box, const int at[3], int side)
{
    const int a = side / 2, there = at[a] + box->low[a] + (side & 1 ? 1 : -1);
    return box->wall[side] && (there < box->begin[a] || there >= box->end[a]);
}

/* The cell `steps` beyond one on a side: around a periodic axis, or the mirror image behind a
 * wall. 0 if the box has none there. */
GS4I_INLINE int gs4i_box_beyond(const gs4i_box *box, const int at[3], int side, int steps,
                                size_t *cell)
{
    const int a = side / 2, begin = box->begin[a], end = box->end[a];
    int there = at[a] + box->low[a] + (side & 1 ? steps : -steps), p[3];
    if (box->periodic[a])
        there = (there + end) % end;
    else if (box->wall[side] && (there < begin || there >= end))
        there = there < begin ? 2 * begin - 1 - there : 2 * end - 1 - there;
    p[0] = at[0];
    p[1] = at[1];
    p[2] = at[2];
    p[a] = there - box->low[a];
    if (p[a] < 0 || p[a] >= box->size[a]) return 0;
    *cell = gs4i_box_index(box, GS4I_AT_CELL, p[0], p[1], p[2]);
    return 1;
}

/* ==== [[elliptic]] one scalar equation on the box ============================================== *
 *
 *     d_i x_i - (1/h^2) sum_faces c_f (x_j - x_i) = b_i        in cells with an unknown,
 *
 * d > 0 at cells, c >= 0 at faces (0: closed), neighbours around periodic axes included: what a
 * step asks of heat. First a few sweeps; else [[poisson]]'s multigrid; along periodic axes, of
 * which that knows nothing, as the preconditioner of [[krylov]]. */

typedef struct gs4i_elliptic {
    const gs4i_box *box;
    const gs4i_tasks *tasks;
    gs4_real h, inv_h;
    uint8_t *kind; /* GS4_CELL_LIQUID: an unknown; GS4_CELL_SOLID */
    /* d; c of the faces across each axis; b; the unknown, 0 at the start */
    gs4_real *diagonal, *face[3], *rhs, *x;
    /* scratch: residual of the sweeps; diagonal, then right-hand side of the preconditioner;
     * with a periodic axis what that gives, the vectors of [[krylov]] and two numbers of parts; the
     * part that a cell belongs to, by its first cell */
    gs4_real *scratch, *correction;
    double *vectors, *part_capacity, *part_mean;
    size_t *part;
    int first[3], end[3]; /* the cells that are solved for; around a periodic axis those at its ends
                           * are neighbours */
    int cycles;           /* of the preconditioner: 0: as many as it needs, or 1 */
    gs4i_solver solver;
    double tolerance;   /* relative residual */
    int max_iterations; /* of the multigrid, and of what is around it */
    int iterations;     /* out: sweeps or cycles */
    double residual;    /* out: relative */
} gs4i_elliptic;

static int gs4i_box_is_periodic(const gs4i_box *box)
{
    return box->periodic[0] || box->periodic[1] || box->periodic[2];
}

/* Bytes of the fields at an entry of the box; and the fields. */
static size_t gs4i_elliptic_bytes(const gs4i_box *box)
{
    const size_t reals = gs4i_box_is_periodic(box) ? 8 : 7;
    return reals * sizeof(gs4_real) + 1
           + (gs4i_box_is_periodic(box) ? 6 * sizeof(double) + sizeof(size_t) : 0);
}
/* What only periodic axes ask for. */
static void gs4i_elliptic_take_periodic(gs4i_elliptic *e, gs4i_box *box)
{
    e->vectors = (double *)gs4i_box_take(box, 4 * sizeof(double));
    e->part_capacity = (double *)gs4i_box_take(box, sizeof(double));
    e->part_mean = (double *)gs4i_box_take(box, sizeof(double));
    e->part = (size_t *)gs4i_box_take(box, sizeof(size_t));
    e->correction = (gs4_real *)gs4i_box_take(box, sizeof(gs4_real));
}

static void gs4i_elliptic_take(gs4i_elliptic *e, gs4i_box *box)
{
    int a;
    e->box = box;
    e->vectors = NULL;
    e->correction = NULL;
    e->cycles = 0;
    for (a = 0; a < 3; a++) {
        e->first[a] = 0;
        e->end[a] = box->size[a];
    }
    if (gs4i_box_is_periodic(box)) gs4i_elliptic_take_periodic(e, box);
    e->diagonal = (gs4_real *)gs4i_box_take(box, sizeof(gs4_real));
    e->rhs = (gs4_real *)gs4i_box_take(box, sizeof(gs4_real));
    e->x = (gs4_real *)gs4i_box_take(box, sizeof(gs4_real));
    e->scratch = (gs4_real *)gs4i_box_take(box, sizeof(gs4_real));
    for (a = 0; a < 3; a++) e->face[a] = (gs4_real *)gs4i_box_take(box, sizeof(gs4_real));
    e->kind = (uint8_t *)gs4i_box_take(box, 1);
}

/* sum_faces c_f (T_j - T_i) of cell i = at. Faces without a cell beyond are closed. */
GS4I_INLINE gs4_real gs4i_elliptic_inflow(const gs4i_elliptic *e, const gs4_real *T,
                                          const int at[3], size_t i)
{
    const gs4i_box *box = e->box;
    const size_t row = (size_t)box->size[0], plane = row * (size_t)box->size[1], x_round = row - 1,
                 y_round = plane - row, z_round = plane * (size_t)(box->size[2] - 1);
    const gs4_real *fx = e->face[0], *fy = e->face[1], *fz = e->face[2];
    size_t face[6];
    gs4i_box_faces_of(box, at, face);
    return fx[face[0]] * (T[at[0] ? i - 1 : i + x_round] - T[i])
           + fx[face[1]] * (T[at[0] < box->size[0] - 1 ? i + 1 : i - x_round] - T[i])
           + fy[face[2]] * (T[at[1] ? i - row : i + y_round] - T[i])
           + fy[face[3]] * (T[at[1] < box->size[1] - 1 ? i + row : i - y_round] - T[i])
           + fz[face[4]] * (T[at[2] ? i - plane : i + z_round] - T[i])
           + fz[face[5]] * (T[at[2] < box->size[2] - 1 ? i + plane : i - z_round] - T[i]);
}

/* --- sweeps ----------------------------------------------------------------------------------- */

/* b - A x of one plane. */
static void gs4i_elliptic_residual(int z, void *context)
{
    const gs4i_elliptic *e = (const gs4i_elliptic *)context;
    const gs4_real per_area = e->inv_h * e->inv_h;
    size_t i;
    int at[3];
    GS4I_BOX_PLANE(e->box, GS4I_AT_CELL, z, at, i)
        if (e->kind[i] == GS4_CELL_LIQUID)
            e->scratch[i] = (e->rhs[i] - e->diagonal[i] * e->x[i])
                            + per_area * gs4i_elliptic_inflow(e, e->x, at, i);
}

/* x += r / d. The norm of r. */
static double gs4i_elliptic_relax(const gs4i_elliptic *e, const gs4_real *r)
{
    const size_t n = gs4i_box_count(e->box, GS4I_AT_CELL);
    double sum = 0;
    size_t i;
    for (i = 0; i < n; i++)
        if (e->kind[i] == GS4_CELL_LIQUID) {
            sum += (double)r[i] * (double)r[i];
            e->x[i] += r[i] / e->diagonal[i];
        }
    return sqrt(sum);
}

/* Jacobi's iteration with d in place of the whole diagonal: a sweep multiplies the error by at
 * most 2 sum c / (h^2 d), where the sum goes over the six faces of a cell. In a step that follows
 * sound heat moves by much less than a cell: that is 0.02 or so, and two to four sweeps do. One
 * costs 1/13 to 1/18 of a multigrid solve with its setup (measured, 32^3 and 64^3 cells). Given
 * up, x = 0 again, where GS4I_MORE_SWEEPS at the factor seen last would not do. */
#define GS4I_MORE_SWEEPS 12
static int gs4i_solve_by_sweeps(gs4i_elliptic *e)
{
    const double size = gs4i_elliptic_relax(e, e->rhs);
    double before, norm = size;
    do {
        before = norm;
        gs4i_parallel_for(e->tasks, e->box->size[2], gs4i_elliptic_residual, e);
        norm = gs4i_elliptic_relax(e, e->scratch);
        e->iterations++;
        if (norm <= e->tolerance * size) {
            e->residual = size > 0 ? norm / size : 0;
            return 1;
        }
    } while (norm * pow(norm / before, GS4I_MORE_SWEEPS) < e->tolerance * size);
    memset(e->x, 0, gs4i_box_count(e->box, GS4I_AT_CELL) * sizeof *e->x);
    return 0;
}

/* --- periodic axes ---------------------------------------------------------------------------- */

typedef struct gs4i_elliptic_product {
    const gs4i_elliptic *e;
    const double *p;
    double *out;
} gs4i_elliptic_product;

/* A p, neighbours around periodic axes included, of one plane. */
static void gs4i_elliptic_apply_plane(int z, void *context)
{
    const gs4i_elliptic_product *task = (const gs4i_elliptic_product *)context;
    const gs4i_elliptic *e = task->e;
    const gs4i_box *box = e->box;
    const double per_area = (double)e->inv_h * (double)e->inv_h;
    size_t face[6], i;
    int at[3], side;
    GS4I_BOX_PLANE(box, GS4I_AT_CELL, z, at, i) {
        double flow = 0;
        if (e->kind[i] != GS4_CELL_LIQUID) {
            task->out[i] = 0;
            continue;
        }
        gs4i_box_faces_of(box, at, face);
        for (side = 0; side < 6; side++) {
            const int a = side / 2;
            int to[3];
            to[0] = at[0];
            to[1] = at[1];
            to[2] = at[2];
            to[a] += side & 1 ? 1 : -1;
            if (to[a] < e->first[a])
                to[a] = e->end[a] - 1;
            else if (to[a] == e->end[a])
                to[a] = e->first[a];
            flow +=
                (double)e->face[a][face[side]]
                * (task->p[gs4i_box_index(box, GS4I_AT_CELL, to[0], to[1], to[2])] - task->p[i]);
        }
        task->out[i] = (double)e->diagonal[i] * task->p[i] - per_area * flow;
    }
}
static void gs4i_elliptic_apply(void *context, const double *p, double *out)
{
    gs4i_elliptic_product product;
    product.e = (const gs4i_elliptic *)context;
    product.p = p;
    product.out = out;
    gs4i_parallel_for(product.e->tasks, product.e->box->size[2], gs4i_elliptic_apply_plane,
                      &product);
}

/* The diagonal of the preconditioner: faces around the periodic axes count as faces to 0. */
static void gs4i_unwrapped_diagonal(const gs4i_elliptic *e, gs4_real *diagonal)
{
    const gs4i_box *box = e->box;
    const gs4_real per_area = e->inv_h * e->inv_h;
    size_t i, face[6];
    int at[3], side, z;
    for (z = 0; z < box->size[2]; z++)
        GS4I_BOX_PLANE(box, GS4I_AT_CELL, z, at, i) {
            gs4i_box_faces_of(box, at, face);
            diagonal[i] = e->diagonal[i];
            for (side = 0; side < 6; side++)
                if (at[side / 2] == (side & 1 ? box->size[side / 2] - 1 : 0))
                    diagonal[i] += per_area * e->face[side / 2][face[side]];
        }
}

/* A part is what faces join. Where d is small against c/h^2 its mean hides in a residual: A times
 * a constant is d, and the heat of the part is sum d x. So means are solved for beside the rest
 * (deflation: Nicolaides 1987). With W the indicators of parts W^T A W is diagonal, sums of d:
 *     x = W m + y,   m = sum b / sum d,   W^T A y = sum d y = 0 in each part.
 * Where all d of a part are 0 b has no mean there, and x is to have none. A part that joins air
 * needs nothing of this: x is 0 there. */
static size_t gs4i_first_of_part(size_t *part, size_t i)
{
    while (part[i] != i) i = part[i] = part[part[i]];
    return i;
}

static void gs4i_join_parts(gs4i_elliptic *e)
{
    const gs4i_box *box = e->box;
    size_t face[6], i;
    int at[3], a, z;
    for (i = 0; i < gs4i_box_count(box, GS4I_AT_CELL); i++) e->part[i] = i;
    for (z = e->first[2]; z < e->end[2]; z++)
        GS4I_BOX_PLANE(box, GS4I_AT_CELL, z, at, i) {
            if (at[0] < e->first[0] || at[0] >= e->end[0] || at[1] < e->first[1]
                || at[1] >= e->end[1])
                continue;
            gs4i_box_faces_of(box, at, face);
            for (a = 0; a < 3; a++) {
                int before[3];
                size_t one, other;
                if (!(e->face[a][face[2 * a]] > 0)) continue;
                memcpy(before, at, sizeof before);
                before[a] = (at[a] > e->first[a] ? at[a] : e->end[a]) - 1;
                one = gs4i_first_of_part(e->part, i);
                other = gs4i_first_of_part(
                    e->part, gs4i_box_index(box, GS4I_AT_CELL, before[0], before[1], before[2]));
                e->part[one < other ? other : one] = one < other ? one : other;
            }
        }
}

/* part_capacity: the sum of d; where that is 0 as many times -1 as there are cells; 0 with air. */
static void gs4i_find_parts(gs4i_elliptic *e)
{
    const size_t n = gs4i_box_count(e->box, GS4I_AT_CELL);
    double *cells = e->part_mean;
    size_t k;
    gs4i_join_parts(e);
    for (k = 0; k < n; k++) e->part_capacity[k] = cells[k] = 0;
    for (k = 0; k < n; k++) {
        e->part[k] = gs4i_first_of_part(e->part, k);
        if (e->kind[k] == GS4_CELL_LIQUID) {
            e->part_capacity[e->part[k]] += (double)e->diagonal[k];
            cells[e->part[k]]++;
        } else if (e->kind[k] == GS4_CELL_AIR)
            cells[e->part[k]] -= HUGE_VAL;
    }
    for (k = 0; k < n; k++)
        if (cells[k] < 0)
            e->part_capacity[k] = 0;
        else if (!(e->part_capacity[k] > 0))
            e->part_capacity[k] = -cells[k];
}

/* The weight of a cell in the mean of its part. */
GS4I_INLINE double gs4i_weight_in_part(const gs4i_elliptic *e, size_t i)
{
    return e->part_capacity[e->part[i]] > 0 ? (double)e->diagonal[i] : 1;
}

/* Means of v in each part, of sums or of values by their weight; 0 where air is. */
static void gs4i_find_means(const gs4i_elliptic *e, const double *v, int are_sums)
{
    const size_t n = gs4i_box_count(e->box, GS4I_AT_CELL);
    double *mean = e->part_mean;
    size_t i;
    memset(mean, 0, n * sizeof *mean);
    for (i = 0; i < n; i++)
        if (e->kind[i] == GS4_CELL_LIQUID)
            mean[e->part[i]] += are_sums ? v[i] : gs4i_weight_in_part(e, i) * v[i];
    for (i = 0; i < n; i++)
        mean[i] = e->part_capacity[i] != 0 ? mean[i] / fabs(e->part_capacity[i]) : 0;
}

/* One multigrid solve without the faces around: few eigenvalues of what is left differ from 1. It
 * goes to the rounding of its float cycles, so that the preconditioner is linear; 1e-6 will do. Or
 * one cycle, whose length does not matter: directions of conjugate gradients have none. */
static int gs4i_elliptic_precondition(void *context, const double *r, double *out)
{
    gs4i_elliptic *e = (gs4i_elliptic *)context;
    const size_t n = gs4i_box_count(e->box, GS4I_AT_CELL);
    gs4_solve_stats stats;
    size_t i;
    int result;
    memset(&stats, 0, sizeof stats);
    for (i = 0; i < n; i++) {
        e->scratch[i] = GS4I_C(r[i]);
        e->correction[i] = 0;
    }
    result =
        gs4i_solver_solve(&e->solver, e->scratch, e->correction, fmax(1e-3 * e->tolerance, 1e-11),
                          e->cycles ? e->cycles : e->max_iterations, &stats);
    e->iterations += stats.iterations;
    if (result != GS4_OK
        && (result != GS4_ERROR_NOT_CONVERGED || !(e->cycles || stats.residual < 1e-6)))
        return result;
    for (i = 0; i < n; i++) out[i] = e->kind[i] == GS4_CELL_LIQUID ? (double)e->correction[i] : 0;
    gs4i_find_means(e, out, 0);
    for (i = 0; i < n; i++)
        if (e->kind[i] == GS4_CELL_LIQUID) out[i] -= e->part_mean[e->part[i]];
    return GS4_OK;
}

static int gs4i_solve_periodic(gs4i_elliptic *e)
{
    const size_t n = gs4i_box_count(e->box, GS4I_AT_CELL);
    gs4i_krylov k;
    double size, rest;
    size_t i;
    int result;
    k.n = n;
    k.x = e->vectors;
    k.r = k.x + n;
    k.p = k.r + n;
    k.q = k.p + n;
    k.apply = gs4i_elliptic_apply;
    k.precondition = gs4i_elliptic_precondition;
    k.context = e;
    for (i = 0; i < n; i++) k.r[i] = (double)e->rhs[i];
    size = sqrt(gs4i_krylov_dot(k.r, k.r, n));
    gs4i_find_parts(e);
    gs4i_find_means(e, k.r, 1);
    for (i = 0; i < n; i++) {
        e->x[i] = 0;
        if (e->kind[i] != GS4_CELL_LIQUID) continue;
        k.r[i] -= gs4i_weight_in_part(e, i) * e->part_mean[e->part[i]];
        if (e->part_capacity[e->part[i]] > 0) e->x[i] = GS4I_C(e->part_mean[e->part[i]]);
    }
    rest = sqrt(gs4i_krylov_dot(k.r, k.r, n));
    result =
        gs4i_conjugate_gradients(&k, rest > 0 ? e->tolerance * size / rest : 1, e->max_iterations);
    for (i = 0; i < n; i++) e->x[i] += GS4I_C(k.x[i]);
    e->residual = size > 0 ? k.residual * rest / size : 0;
    return result;
}

/* --- all of it -------------------------------------------------------------------------------- */

/* GS4_OK, GS4_ERROR_MEMORY, GS4_ERROR_NOT_CONVERGED (`residual` says how far it is), or
 * GS4_ERROR_ARGUMENT for numbers that are not finite or absurd (solver.fault says which). */
static int gs4i_elliptic_solve(gs4i_elliptic *e, const gs4_sim_desc *desc)
{
    gs4_poisson_desc d;
    gs4_solve_stats stats;
    int a, result;
    e->iterations = 0;
    if (gs4i_solve_by_sweeps(e)) return GS4_OK;
    e->iterations = 0;
    memset(&d, 0, sizeof d);
    memset(&stats, 0, sizeof stats);
    for (a = 0; a < 3; a++) {
        d.cells[a] = e->box->size[a];
        d.coefficient[a] = e->face[a];
    }
    d.cell_size = e->h;
    d.kind = e->kind;
    d.diagonal = e->diagonal;
    d.threads = desc->threads;
    d.parallel_for = desc->parallel_for;
    if (e->vectors) {
        gs4i_unwrapped_diagonal(e, e->scratch);
        d.diagonal = e->scratch;
    }
    result = gs4i_solver_setup(&e->solver, &d);
    if (result != GS4_OK) return result;
    if (e->vectors) return gs4i_solve_periodic(e);
    result = gs4i_solver_solve(&e->solver, e->rhs, e->x, e->tolerance, e->max_iterations, &stats);
    e->iterations += stats.iterations;
    e->residual = stats.residual;
    return result;
}

/* ==== [[particles]] the store, and how it is sorted by block =================================== *
 *
 * Arrays of small vectors, each 16 bytes in float where it can be. Sorting permutes in place along
 * the cycles of the permutation, so nothing is stored twice. */

/* When the rates are: by (4) a rate belongs to (gamma - 1/2) dt before the time of its quantity. So
 * in free flight dx/dt = v - shift a exactly. What dx/dt differs from that, the position residual,
 * is small enough for a half. */
typedef struct gs4i_prediction {
    gs4_real ahead /* alpha_f dt */, shift /* (gamma - 1/2) dt of the last step */;
    gs4_real bend; /* (alpha_f dt)^2/2 of the partitioned scheme, 0 of others */
} gs4i_prediction;

/* Rule (4) for one step of size dt, and what goes with the step. */
typedef struct gs4i_integrator {
    gs4_real dt, alpha_m, alpha_f, gamma, inv_alpha_m;
    gs4i_prediction prediction;
    gs4_real s;          /* s = alpha_f gamma dt / alpha_m: weight of the new rate at the stage */
    gs4_real before;     /* y** = y + before r: alpha_f dt - s; 0 for symplectic Euler */
    gs4_real next_shift; /* prediction.shift of the next step */
    int restart;         /* no rates yet: first step, or after an edit */
    /* Share of feedback after an impact. As a rate a it gives velocity in later steps, too; after
     * a first step, which takes it whole, (alpha_m - gamma) a dt in all. */
    gs4_real impact;
    /* Decay of what the grid does not see, at the rate k = 1/flip_decay_time and as noise crosses
     * cells: see gs4i_set_decay. */
    gs4_real decay;           /* k, 1/s */
    gs4_real stable_decay;    /* the rate that is taken for k, 1/s */
    gs4_real inv_stable;      /* 1 / the fastest rate that is taken, 0.8 k_max, s */
    gs4_real decayed_at_once; /* share that goes in the step itself, where k dt > 1; else 0 */
    gs4_real crossing;        /* k_n = crossing |v~ - V|: 1/h, or 0 */
    gs4_real volume_crossing; /* k_J has volume_crossing |Jbar - J~|: c0/h, or 0 */
    gs4_real weight_crossing; /* less this, |g|/c0, 1/s: what weight alone makes of it */
    gs4_real unpacking;       /* how fast J follows packing, c0/(200 h), 1/s; 0: not at all */
    gs4_real fast_decay;      /* c0 / h, 1/s: added to k where the grid sees little */
    gs4_real affine_ratio; /* C of the stage goes on from its last change by this: dt/dt before */
    gs4_real stopping;     /* how fast friction stops a node: k_max/2, 1/s */
    /* 1/h^2; 1 / mass of a node in the midst of the lightest material, and of the densest */
    gs4_real inv_area, inv_node_mass, inv_densest_node_mass;
} gs4i_integrator;

/* `noise`: in, the rate of decay as noise; out, what that adds to `stable_decay`, 1/s. As in
 * gs4i_set_decay a rate k is taken as k (1 + x)/(1 + x + x^2), x = k/(0.8 k_max). */
GS4I_INLINE void gs4i_faster(const gs4i_integrator *r, gs4_real decay, gs4_real stable_decay,
                             gs4i_wide *noise)
{
    const gs4i_wide k = *noise + decay, x = k * r->inv_stable;
    *noise = k * (GS4I_C(1) + x) / (GS4I_C(1) + x + x * x) - stable_decay;
}

#ifdef GS4_DOUBLE
typedef float gs4i_half; /* half of gs4_real's width, for the position residual */
#else
typedef uint16_t gs4i_half; /* the upper half of a float, rounded */
#endif

GS4I_INLINE gs4i_half gs4i_to_half(gs4_real v)
{
#ifdef GS4_DOUBLE
    /* a jump may give more than there is room for: C has no such conversion */
    const gs4_real most = GS4I_C(FLT_MAX);
    return (gs4i_half)(v > most ? most : v < -most ? -most : v);
#else
    uint32_t u;
    memcpy(&u, &v, sizeof u);
    return (gs4i_half)((u + 0x7fffu + ((u >> 16) & 1u)) >> 16);
#endif
}

GS4I_INLINE gs4_real gs4i_from_half(gs4i_half v)
{
#ifdef GS4_DOUBLE
    return (gs4_real)v;
#else
    const uint32_t u = (uint32_t)v << 16;
    gs4_real r;
    memcpy(&r, &u, sizeof r);
    return r;
#endif
}

typedef struct gs4i_particles {
    /* arrays are one element longer than that: a quad may be read over the end */
    int count, capacity, with_rates;
    gs4_real *position; /* 4: x y z, mass */
    gs4_real *velocity; /* 4: v, volume ratio J */
    gs4_real *rate;     /* 4: dv/dt, dJ/dt; NULL for symplectic Euler */
    /* 4 each: column j of the velocity gradient, dv_i/dx_j; NULL for GS4 */
    gs4_real *affine[3];
    /* partitioned: the same of the step before; affine[0] has the pressure (Pa) as its fourth */
    gs4_real *affine_before[3];
    int with_affine, with_affine_before;
    /* 12: non-local stress xx yy zz xy xz yz (Pa) and its rate; 6 for Euler; 0: the scene has
     * none */
    gs4_real *elastic;
    int elastic_reals;
    /* 24, see [[solid]]: F, row-major, M (1/s), spin (rad/s) and its rate; 9 for Euler; 0:
     * none */
    gs4_real *deformation;
    int deformation_reals;
    /* 4: temperature, liquid fraction, rate of enthalpy over heat capacity, what rounding still
     * owes the temperature; 0: the scene has none */
    gs4_real *heat;
    int with_heat;
    uint8_t *liquid; /* 1 while liquid; with heat */
    /* 4 each: non-local heat flux (W/m^2), 0, and its rate; 0: the scene has none */
    gs4_real *flux, *flux_rate;
    int with_flux;
    /* 4: v - shift a - dx/dt; decay of J in the last step, 1/s; NULL for symplectic Euler */
    gs4i_half *position_residual;
    /* 4: V - v~ and how fast it decays as noise, from S4 to S7 of a step; NULL
     * where it does not */
    gs4_real *subgrid;
    int with_subgrid;
    uint32_t *id;
    uint8_t *material;
    uint32_t *order; /* scratch: block, then destination of each particle */
} gs4i_particles;

/* Those of the state come first, then scratch. */
enum {
    GS4I_ARRAYS = 20,
    GS4I_STATE_ARRAYS = 18
};
typedef struct gs4i_array {
    void **data;
    size_t size;
    int wanted;
} gs4i_array;

/* The arrays of a store with the size of one element, largest first: for growing, sorting,
 * hashing, saving. */
static void gs4i_particle_arrays(gs4i_particles *p, gs4i_array out[GS4I_ARRAYS])
{
    int i;
    for (i = 0; i < 3; i++) {
        out[i].data = (void **)&p->affine[i];
        out[i].size = 4 * sizeof(gs4_real);
    }
    out[3].data = (void **)&p->position;
    out[3].size = 4 * sizeof(gs4_real);
    out[4].data = (void **)&p->velocity;
    out[4].size = 4 * sizeof(gs4_real);
    out[5].data = (void **)&p->rate;
    out[5].size = 4 * sizeof(gs4_real);
    out[6].data = (void **)&p->position_residual;
    out[6].size = 4 * sizeof(gs4i_half);
    out[7].data = (void **)&p->id;
    out[7].size = sizeof(uint32_t);
    out[8].data = (void **)&p->material;
    out[8].size = 1;
    out[9].data = (void **)&p->elastic;
    out[9].size = (size_t)p->elastic_reals * sizeof(gs4_real);
    out[10].data = (void **)&p->heat;
    out[10].size = 4 * sizeof(gs4_real);
    out[11].data = (void **)&p->flux;
    out[11].size = 4 * sizeof(gs4_real);
    out[12].data = (void **)&p->flux_rate;
    out[12].size = 4 * sizeof(gs4_real);
    out[13].data = (void **)&p->liquid;
    out[13].size = 1;
    out[14].data = (void **)&p->deformation;
    out[14].size = (size_t)p->deformation_reals * sizeof(gs4_real);
    for (i = 0; i < 3; i++) {
        out[15 + i].data = (void **)&p->affine_before[i];
        out[15 + i].size = 4 * sizeof(gs4_real);
    }
    out[18].data = (void **)&p->order;
    out[18].size = sizeof(uint32_t);
    out[19].data = (void **)&p->subgrid;
    out[19].size = 4 * sizeof(gs4_real);
    for (i = 0; i < GS4I_ARRAYS; i++)
        out[i].wanted = i < 3                ? p->with_affine
                        : i >= 15 && i <= 17 ? p->with_affine_before
                                             : p->with_rates || (i != 5 && i != 6);
    out[9].wanted = p->elastic_reals > 0;
    out[14].wanted = p->deformation_reals > 0;
    out[10].wanted = out[13].wanted = p->with_heat;
    out[11].wanted = out[12].wanted = p->with_flux;
    out[19].wanted = p->with_subgrid;
}

static void gs4i_particles_free(gs4i_memory *m, gs4i_particles *p)
{
    gs4i_array a[GS4I_ARRAYS];
    int i;
    gs4i_particle_arrays(p, a);
    for (i = 0; i < GS4I_ARRAYS; i++) {
        gs4i_free(m, *a[i].data, (size_t)p->capacity + 1, a[i].size);
        *a[i].data = NULL;
    }
    p->capacity = 0;
}

/* Room for `wanted` particles in all. All or nothing. */
static int gs4i_particles_reserve(gs4i_memory *m, gs4i_particles *p, int wanted)
{
    gs4i_particles grown = *p;
    gs4i_array from[GS4I_ARRAYS], to[GS4I_ARRAYS];
    int i, failed = 0;
    if (wanted <= p->capacity) return GS4_OK;
    gs4i_particle_arrays(p, from);
    gs4i_particle_arrays(&grown, to);
    for (i = 0; i < GS4I_ARRAYS; i++) *to[i].data = NULL;
    grown.capacity = wanted;
    for (i = 0; i < GS4I_ARRAYS && !failed; i++)
        if (to[i].wanted)
            failed = (*to[i].data = gs4i_alloc(m, (size_t)wanted + 1, to[i].size)) == NULL;
    if (failed) {
        gs4i_particles_free(m, &grown);
        return GS4_ERROR_MEMORY;
    }
    for (i = 0; i < GS4I_ARRAYS; i++)
        if (*from[i].data) memcpy(*to[i].data, *from[i].data, (size_t)p->count * from[i].size);
    gs4i_particles_free(m, p);
    *p = grown;
    return GS4_OK;
}

#define GS4I_LEADER 0x80000000u /* in `order`: start of a cycle that moves something */
#define GS4I_VISITED 0x40000000u
#define GS4I_DESTINATION 0x3fffffffu
#define GS4I_MAX_PARTICLES 0x3ffffff0

static void gs4i_mark_cycles(uint32_t *order, int count)
{
    int i;
    for (i = 0; i < count; i++) {
        uint32_t j = (uint32_t)i;
        if (order[i] & GS4I_VISITED) continue;
        if ((order[i] & GS4I_DESTINATION) != j) order[i] |= GS4I_LEADER;
        do {
            order[j] |= GS4I_VISITED;
            j = order[j] & GS4I_DESTINATION;
        } while (j != (uint32_t)i);
    }
}

GS4I_INLINE void gs4i_permute_sized(char *data, size_t size, const uint32_t *order, int count)
{
    char carried[24 * sizeof(double)], swapped[24 * sizeof(double)];
    int i;
    for (i = 0; i < count; i++) {
        uint32_t j = (uint32_t)i;
        if (!(order[i] & GS4I_LEADER)) continue;
        memcpy(carried, data + j * size, size);
        do {
            j = order[j] & GS4I_DESTINATION;
            memcpy(swapped, data + j * size, size);
            memcpy(data + j * size, carried, size);
            memcpy(carried, swapped, size);
        } while (j != (uint32_t)i);
    }
}

/* Moves every element of array `index` to its destination. Sizes are constants where they can be,
 * so that the compiler copies without a call. */
static void gs4i_permute_task(int index, void *context)
{
    gs4i_particles *p = (gs4i_particles *)context;
    gs4i_array a[GS4I_ARRAYS];
    char *data;
    gs4i_particle_arrays(p, a);
    data = (char *)*a[index].data;
    if (!data) return;
    switch (a[index].size) {
    case 192: gs4i_permute_sized(data, 192, p->order, p->count); break;
    case 96: gs4i_permute_sized(data, 96, p->order, p->count); break;
    case 48: gs4i_permute_sized(data, 48, p->order, p->count); break;
    case 36: gs4i_permute_sized(data, 36, p->order, p->count); break;
    case 32: gs4i_permute_sized(data, 32, p->order, p->count); break;
    case 24: gs4i_permute_sized(data, 24, p->order, p->count); break;
    case 16: gs4i_permute_sized(data, 16, p->order, p->count); break;
    case 8: gs4i_permute_sized(data, 8, p->order, p->count); break;
    case 4: gs4i_permute_sized(data, 4, p->order, p->count); break;
    default: gs4i_permute_sized(data, a[index].size, p->order, p->count); break;
    }
}

/* Counting sort by block, stable. The number of chunks depends on the number of particles alone,
 * so that the order does not depend on threads. */
typedef struct gs4i_sorting {
    gs4i_particles *p;
    gs4i_grid *g;
    gs4i_prediction prediction; /* sorted by where they are expected at the stage */
    int chunks;
    uint32_t *histogram; /* [chunk][occupied block] */
} gs4i_sorting;

GS4I_INLINE void gs4i_chunk(const gs4i_sorting *s, int index, int *begin, int *end)
{
    *begin = (int)((int64_t)s->p->count * index / s->chunks);
    *end = (int)((int64_t)s->p->count * (index + 1) / s->chunks);
}

/* What a batch of particles is. With symplectic Euler rates and position residuals are zero. */
typedef struct gs4i_batch {
    gs4i_lanes x[4];    /* and mass */
    gs4i_lanes v[4];    /* and J */
    gs4i_lanes a[4];    /* dv/dt and dJ/dt */
    gs4i_lanes move[3]; /* dx/dt */
    gs4i_lanes fades;   /* what decay of noise gave dJ/dt, see gs4i_volume_decay */
} gs4i_batch;

/* Asks for a batch before it is needed: processors by themselves fetch ahead to the end of a page
 * of memory only. */
GS4I_INLINE void gs4i_prefetch_particles(const gs4i_particles *p, size_t i)
{
    int b;
    if (i + GS4I_BATCH > (size_t)p->count) return;
    for (b = 0; b < 4 * GS4I_BATCH; b += 16) {
        GS4I_PREFETCH(p->position + 4 * i + b);
        GS4I_PREFETCH(p->velocity + 4 * i + b);
        if (p->with_rates)
            GS4I_PREFETCH(p->rate + 4 * i + b);
        else
            GS4I_PREFETCH(p->affine[0] + 4 * i + b);
        if (p->with_rates)
            GS4I_PREFETCH(p->position_residual + 4 * i + b);
        else {
            GS4I_PREFETCH(p->affine[1] + 4 * i + b);
            GS4I_PREFETCH(p->affine[2] + 4 * i + b);
        }
    }
    for (b = 0; b < p->elastic_reals * GS4I_BATCH; b += 16)
        GS4I_PREFETCH(p->elastic + (size_t)p->elastic_reals * i + b);
    for (b = 0; b < p->deformation_reals * GS4I_BATCH; b += 16)
        GS4I_PREFETCH(p->deformation + (size_t)p->deformation_reals * i + b);
    for (b = 0; b < 4 * GS4I_BATCH && p->heat; b += 16) GS4I_PREFETCH(p->heat + 4 * i + b);
}

/* Particles i to i + n; four batches ahead, chosen, are asked for. */
GS4I_INLINE void gs4i_load_batch(const gs4i_particles *p, size_t i, int n,
                                 gs4i_prediction prediction, gs4i_batch *q)
{
    gs4_real halves[4 * GS4I_BATCH];
    gs4i_lanes position_residual[4];
    int b, c;
    gs4i_prefetch_particles(p, i + 4 * GS4I_BATCH);
    gs4i_to_lanes(p->position + 4 * i, n, q->x);
    gs4i_to_lanes(p->velocity + 4 * i, n, q->v);
    if (!p->with_rates) {
        memset(q->a, 0, sizeof q->a);
        for (c = 0; c < 3; c++)
            GS4I_BATCH_LOOP(b) q->move[c][b] = q->v[c][b];
        memset(q->fades, 0, sizeof q->fades);
        return;
    }
    gs4i_to_lanes(p->rate + 4 * i, n, q->a);
    if (n == GS4I_BATCH)
        for (b = 0; b < 4 * GS4I_BATCH; b++)
            halves[b] = gs4i_from_half(p->position_residual[4 * i + (size_t)b]);
    else
        for (b = 0; b < 4 * n; b++)
            halves[b] = gs4i_from_half(p->position_residual[4 * i + (size_t)b]);
    gs4i_to_lanes(halves, n, position_residual);
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b)
            q->move[c][b] = (q->v[c][b] - prediction.shift * q->a[c][b]) - position_residual[c][b];
    memcpy(q->fades, position_residual[3], sizeof q->fades);
}

/* S2: x~ = x + alpha_f dt dx/dt. With steps as long as the partitioned scheme's, surfaces are where
 * they will be only with the acceleration: without, waves of 20 steps grow 3 % a period. */
GS4I_INLINE void gs4i_predict_positions(const gs4i_batch *q, gs4i_prediction prediction,
                                        gs4i_lanes x[3])
{
    int b, c;
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b) x[c][b] = q->x[c][b] + prediction.ahead * q->move[c][b];
    for (c = 0; c < 3 && prediction.bend > 0; c++)
        GS4I_BATCH_LOOP(b) x[c][b] += prediction.bend * q->a[c][b];
}

static void gs4i_sort_keys_task(int index, void *context)
{
    gs4i_sorting *s = (gs4i_sorting *)context;
    const gs4_real origin[3] = { s->g->origin.x, s->g->origin.y, s->g->origin.z };
    int i, end, a, b;
    gs4i_chunk(s, index, &i, &end);
    for (; i < end; i += GS4I_BATCH) {
        const int n = end - i < GS4I_BATCH ? end - i : GS4I_BATCH;
        gs4i_batch q;
        gs4i_lanes x[3];
        gs4i_load_batch(s->p, (size_t)i, n, s->prediction, &q);
        gs4i_predict_positions(&q, s->prediction, x);
        for (b = 0; b < n; b++) {
            int cell[3];
            for (a = 0; a < 3; a++) {
                const gs4_real c = (GS4I_NTH(x[a], b) - origin[a]) * s->g->inv_h;
                cell[a] = c >= 0 ? (c < GS4I_C(s->g->cells[a]) ? (int)c : s->g->cells[a] - 1) : 0;
            }
            s->p->order[i + b] = gs4i_home_block(s->g, cell);
        }
    }
}

static void gs4i_sort_count_task(int index, void *context)
{
    gs4i_sorting *s = (gs4i_sorting *)context;
    uint32_t *h = s->histogram + (size_t)index * (size_t)s->g->occupied;
    int i, end;
    gs4i_chunk(s, index, &i, &end);
    for (; i < end; i++) h[s->g->occupant[s->g->table[s->p->order[i]] - 1]]++;
}

static void gs4i_sort_place_task(int index, void *context)
{
    gs4i_sorting *s = (gs4i_sorting *)context;
    uint32_t *h = s->histogram + (size_t)index * (size_t)s->g->occupied;
    int i, end;
    gs4i_chunk(s, index, &i, &end);
    for (; i < end; i++) s->p->order[i] = h[s->g->occupant[s->g->table[s->p->order[i]] - 1]]++;
}

/* Lists the blocks that particles are in, ascending, from the keys in `order`, in lists[0]. Returns
 * how many, or an error. */
static int gs4i_list_occupied(gs4i_memory *m, gs4i_sorting *s)
{
    uint32_t last = UINT32_MAX, *list = (uint32_t *)s->g->lists[0].data;
    int i, n = 0, result = GS4_OK;
    for (i = 0; i < s->p->count; i++) {
        uint32_t b = s->p->order[i];
        if (b == last || (s->g->table[b] & GS4I_SEEN)) continue;
        list = (uint32_t *)gs4i_scratch_reserve(m, &s->g->lists[0], (size_t)(n + 1) * sizeof *list,
                                                (size_t)n * sizeof *list);
        if (!list) {
            list = (uint32_t *)s->g->lists[0].data;
            result = GS4_ERROR_MEMORY;
            break;
        }
        s->g->table[b] |= GS4I_SEEN;
        list[n++] = last = b;
    }
    for (i = 0; i < n; i++) s->g->table[list[i]] &= ~GS4I_SEEN;
    if (result != GS4_OK) return result;
    gs4i_sort(list, n);
    return n;
}

/* S1. Sorts the particles by the block of their predicted position and gives nodes to all blocks in
 * reach. Nothing has changed when memory is refused. A chunk has 4096 particles, chosen, or there
 * are 64 chunks. */
static int gs4i_particles_sort(gs4i_memory *m, const gs4i_tasks *tasks, gs4i_particles *p,
                               gs4i_grid *g, gs4i_prediction prediction)
{
    gs4i_sorting s;
    uint32_t sum = 0;
    int count, o, c;
    s.p = p;
    s.g = g;
    s.prediction = prediction;
    s.chunks = p->count / 4096 < 1 ? 1 : p->count / 4096 > 64 ? 64 : p->count / 4096;
    gs4i_parallel_for(tasks, s.chunks, gs4i_sort_keys_task, &s);
    count = gs4i_list_occupied(m, &s);
    if (count < 0) return count;
    s.histogram = (uint32_t *)gs4i_scratch_reserve(
        m, &g->histogram, (size_t)s.chunks * (size_t)count * sizeof *s.histogram, 0);
    if (!s.histogram
        || gs4i_grid_occupy(m, g, (const uint32_t *)g->lists[0].data, count, p->with_rates)
               != GS4_OK)
        return GS4_ERROR_MEMORY;
    memset(s.histogram, 0, (size_t)s.chunks * (size_t)count * sizeof *s.histogram);
    gs4i_parallel_for(tasks, s.chunks, gs4i_sort_count_task, &s);
    for (o = 0; o < count; o++) {
        g->first[o] = (int32_t)sum;
        for (c = 0; c < s.chunks; c++) {
            uint32_t *h = s.histogram + (size_t)c * (size_t)count + o, n = *h;
            *h = sum;
            sum += n;
        }
    }
    g->first[count] = (int32_t)sum;
    gs4i_parallel_for(tasks, s.chunks, gs4i_sort_place_task, &s);
    gs4i_mark_cycles(p->order, p->count);
    gs4i_parallel_for(tasks, GS4I_STATE_ARRAYS, gs4i_permute_task, p);
    return GS4_OK;
}

/* ==== [[liquid]] pressure, viscosity, presets ================================================= */

/* of solids that do not yield; the determinant of F in float means nothing much beyond */
#define GS4I_MOST_STRETCH GS4I_C(512)

/* Viscosity varies: Cross-WLF or viscosity_fn, one by one; Herschel-Bulkley. */
enum {
    GS4I_BY_CALL = 1,
    GS4I_IN_LANES = 2
};

/* What the particles need of a material, ready for use. */
typedef struct gs4i_material_constants {
    gs4_real inv_density, tait; /* 1 / rho0; rho0 c0^2 / 7 */
    /* viscosity: the local part, F_v mu, or the consistency */
    gs4_real viscosity, sound_speed, density;
    gs4_real lone;       /* squared speeds of its waves count so often: see gs4i_lone_waves */
    gs4_real compliance; /* 1/K, 1/Pa, where a solve gives the pressure; 0 where none does */
    gs4_real local, temperature; /* F_v; K, where the scene has no heat: that of the air */
    /* non-local: G0; 1 / lambda_b; 2 lambda_b / lambda_0s; 2 / Q; all 0: none */
    gs4_real modulus, inv_lambda, stretch, nu, alpha;
    /* of solids: G, Pa (0: a liquid), and between what the singular values of F stay */
    gs4_real shear_modulus, low, high;
    gs4_real capacity, conductivity, flux_time, fourier; /* c; k; tau; F_T, 1 where tau is 0 */
    gs4_real reach; /* sqrt(k tau / (rho0 c)), m: of a wave of heat in tau */
    /* T_m, beyond every temperature where the phase is fixed; L / c, K */
    gs4_real melting, latent;
    int varies; /* how viscosity does: 0, GS4I_BY_CALL or GS4I_IN_LANES */
    gs4_viscosity_fn viscosity_fn;
    void *viscosity_user;
    gs4_material is; /* as described */
} gs4i_material_constants;

/* Tait: p = (rho0 c0^2 / 7) (J^-7 - 1) in Pa; grows without bound as J -> 0, never below -rho0
 * c0^2 / 7. */
GS4I_INLINE void gs4i_pressure(const gs4i_wide *tait, const gs4i_wide *J, gs4i_wide *p)
{
    const gs4i_wide i = GS4I_C(1) / *J, i2 = i * i, i4 = i2 * i2;
    *p = *tait * (i4 * i2 * i - GS4I_C(1));
}

/* What the particles of a batch need of their materials. */
typedef struct gs4i_batch_constants {
    gs4i_lanes inv_density, tait, viscosity;
    /* what the limit of the step sees: c0 sqrt(lone), lone / rho0 */
    gs4i_lanes wave_speed, wave_volume;
    /* that of the air where the scene has no heat; else see gs4i_stage_temperature */
    gs4i_lanes temperature;
    const gs4i_material_constants *of[GS4I_BATCH];
    int varies; /* what viscosities of those seen so far do */
} gs4i_batch_constants;

/* Consecutive batches mostly have the same materials: only what differs is looked up. What is
 * solid in a scene with heat goes by `solid_phase`. */
GS4I_INLINE void gs4i_load_constants(const gs4i_material_constants *constants,
                                     const gs4i_material_constants *solid_phase,
                                     const gs4i_particles *p, size_t i, int n,
                                     gs4i_batch_constants *l)
{
    int b;
    for (b = 0; b < GS4I_BATCH; b++) {
        const size_t at = i + (size_t)(b < n ? b : 0);
        const gs4i_material_constants *mat = p->liquid && !p->liquid[at]
                                                 ? &solid_phase[p->material[at]]
                                                 : &constants[p->material[at]];
        if (mat == l->of[b]) continue;
        l->of[b] = mat;
        l->varies |= mat->varies;
        GS4I_NTH(l->inv_density, b) = mat->inv_density;
        GS4I_NTH(l->tait, b) = mat->tait;
        GS4I_NTH(l->viscosity, b) = mat->viscosity;
        GS4I_NTH(l->wave_speed, b) = mat->sound_speed * GS4I_SQRT(mat->lone);
        GS4I_NTH(l->wave_volume, b) = mat->lone * mat->inv_density;
        GS4I_NTH(l->temperature, b) = mat->temperature;
    }
}

static int gs4i_is_default_cross_wlf(const gs4_material *m)
{
    return m->cross_wlf.a == 0 && m->cross_wlf.n == 0 && m->cross_wlf.d1 == 0
           && m->cross_wlf.a1 == 0 && m->cross_wlf.t1 == 0 && m->cross_wlf.t2 == 0;
}

/* Cross-WLF, Pa s: mu = mu0 / (1 + a (mu0 rate)^n), mu0 = d1 exp(-a1 (T - t1) / (T - t2));
 * absurdly large, which is refused, where mu0 is, and from t2 down, where the law ends: a liquid
 * would be a glass there. */
static gs4_real gs4i_cross_wlf(const gs4_material *m, gs4_real temperature, gs4_real shear_rate)
{
    const double T = (double)temperature, n = (double)m->cross_wlf.n;
    const double mu0 = (double)m->cross_wlf.d1
                       * exp(-(double)m->cross_wlf.a1 * (T - (double)m->cross_wlf.t1)
                             / (T - (double)m->cross_wlf.t2));
    if (!(mu0 < (double)GS4I_HUGE) || (m->cross_wlf.a1 > 0 && temperature <= m->cross_wlf.t2))
        return GS4I_HUGE;
    /* 0 times infinity, at rest and with n below 0 */
    if (!(m->cross_wlf.a > 0)) return GS4I_C(mu0);
    return GS4I_C(mu0 / (1 + (double)m->cross_wlf.a * pow(mu0 * (double)shear_rate, n)));
}

/* --- Herschel-Bulkley: powers in lanes and without libm, so the same bits everywhere --- */

/* Of gs4_real: bits of its fraction; 1.5 times 2 to that, a sum with which is rounded to a whole
 * number, in its last bits; bits of sqrt(1/2); terms of the series; the largest power of 2. */
#ifdef GS4_DOUBLE
#define GS4I_FRACTION_BITS 52
#define GS4I_EXPONENT_BITS (-INT64_C(0x10000000000000))
#define GS4I_WHOLE GS4I_C(6755399441055744.0)
#define GS4I_WHOLE_BITS INT64_C(0x4338000000000000)
#define GS4I_ROOT_BITS INT64_C(0x3fe6a09e667f3bcd)
#define GS4I_BIAS 1023
enum {
    GS4I_LOG_TERMS = 11,
    GS4I_EXP_TERMS = 13
};
#else
#define GS4I_FRACTION_BITS 23
#define GS4I_EXPONENT_BITS (-INT32_C(0x800000))
#define GS4I_WHOLE GS4I_C(12582912.0)
#define GS4I_WHOLE_BITS INT32_C(0x4b400000)
#define GS4I_ROOT_BITS INT32_C(0x3f3504f3)
#define GS4I_BIAS 127
enum {
    GS4I_LOG_TERMS = 5,
    GS4I_EXP_TERMS = 7
};
#endif

/* log2 x, x > 0 and not denormal: x = m 2^k with m from sqrt(1/2) to sqrt(2), and with
 * s = (m - 1)/(m + 1), |s| < 0.172: log2 m = (2/ln 2) (s + s^3/3 + s^5/5 + ...). */
GS4I_INLINE void gs4i_log2(const gs4i_wide *x, gs4i_wide *y)
{
    gs4i_wide m, k, s, s2, sum;
    gs4i_wide_bits bits, above;
    int i;
    memcpy(&bits, x, sizeof bits);
    above = bits - GS4I_ROOT_BITS;
    bits -= above & GS4I_EXPONENT_BITS; /* k */
    memcpy(&m, &bits, sizeof m);
    above = (above >> GS4I_FRACTION_BITS) + GS4I_WHOLE_BITS;
    memcpy(&k, &above, sizeof k);
    s = (m - GS4I_C(1)) / (m + GS4I_C(1));
    s2 = s * s;
    sum = 0 * s;
    for (i = GS4I_LOG_TERMS - 1; i >= 0; i--)
        sum = sum * s2 + GS4I_C(2.885390081777926815) / GS4I_C(2 * i + 1);
    *y = (k - GS4I_WHOLE) + s * sum;
}

/* 2^y; beyond what gs4_real holds the largest or the smallest that it does. y = k + f, |f| <= 1/2,
 * 2^f = 1 + f ln 2 + (f ln 2)^2/2 + ... */
GS4I_INLINE void gs4i_exp2(const gs4i_wide *y, gs4i_wide *x)
{
    static const gs4_real term[13] = {
        GS4I_C(6.931471805599452862e-01), GS4I_C(2.402265069591007218e-01),
        GS4I_C(5.550410866482158312e-02), GS4I_C(9.618129107628476879e-03),
        GS4I_C(1.333355814642844328e-03), GS4I_C(1.540353039338160878e-04),
        GS4I_C(1.525273380405984108e-05), GS4I_C(1.321548679014430951e-06),
        GS4I_C(1.017808600923969992e-07), GS4I_C(7.054911620801123359e-09),
        GS4I_C(4.445538271870811625e-10), GS4I_C(2.567843599348820551e-11),
        GS4I_C(1.369148885390412810e-12)
    };
    const gs4i_wide none = 0 * *y, most = none + GS4I_C(GS4I_BIAS - 1), least = -most;
    gs4i_wide f, k, sum = none, scale;
    gs4i_wide_bits bits;
    int i;
    GS4I_WIDE_MIN(f, *y, most);
    GS4I_WIDE_MAX(f, f, least);
    k = f + GS4I_WHOLE;
    memcpy(&bits, &k, sizeof bits);
    bits = (bits - (GS4I_WHOLE_BITS - GS4I_BIAS)) << GS4I_FRACTION_BITS;
    memcpy(&scale, &bits, sizeof scale);
    f -= k - GS4I_WHOLE;
    for (i = GS4I_EXP_TERMS - 1; i >= 0; i--) sum = (sum + term[i]) * f;
    *x = scale + scale * sum;
}

/* Viscosities (Pa s) of a batch, where those of Herschel-Bulkley come in as their consistency:
 * yield_stress / e + consistency e^(index - 1), e^2 = 2 D:D + creep_rate^2. Other liquids are those
 * without a yield stress and of the index 1: theirs stay as they are, to the bit. */
static void gs4i_herschel_bulkley(const gs4i_material_constants *const *of, gs4i_gradient L,
                                  gs4i_wide *mu)
{
    gs4i_lanes yield, power, slowest;
    int n, b;
    for (n = 0; n < GS4I_BATCH; n++) {
        const int plastic = of[n]->varies == GS4I_IN_LANES;
        const gs4_real creep = plastic ? of[n]->is.herschel_bulkley.creep_rate : 0;
        GS4I_NTH(yield, n) = plastic ? of[n]->is.herschel_bulkley.yield_stress : 0;
        GS4I_NTH(power, n) = plastic ? (of[n]->is.herschel_bulkley.index - 1) / 2 : 0;
        GS4I_NTH(slowest, n) = gs4i_max(creep * creep, GS4I_TINY);
    }
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide xy = L[0][1][b] + L[1][0][b], xz = L[0][2][b] + L[2][0][b],
                        yz = L[1][2][b] + L[2][1][b];
        const gs4i_wide e2 =
            2 * (L[0][0][b] * L[0][0][b] + L[1][1][b] * L[1][1][b] + L[2][2][b] * L[2][2][b])
            + (xy * xy + xz * xz + yz * yz) + slowest[b];
        gs4i_wide octaves, exponent, inverse;
        gs4i_log2(&e2, &octaves);
        exponent = GS4I_C(-0.5) * octaves;
        gs4i_exp2(&exponent, &inverse);
        exponent = power[b] * octaves;
        gs4i_exp2(&exponent, &octaves);
        mu[b] = yield[b] * inverse + mu[b] * octaves;
    }
}

/* The same of one particle. */
static gs4_real gs4i_herschel_bulkley_of(const gs4i_material_constants *mat, gs4i_gradient L, int n)
{
    const gs4i_material_constants *of[GS4I_BATCH];
    gs4i_lanes mu;
    int i;
    for (i = 0; i < GS4I_BATCH; i++) {
        of[i] = mat;
        GS4I_NTH(mu, i) = mat->is.herschel_bulkley.consistency;
    }
    gs4i_herschel_bulkley(of, L, mu);
    return GS4I_NTH(mu, n);
}

/* Viscosity (Pa s, in all) of particle n at the temperature T and the shear rate sqrt(2 D:D). */
static gs4_real gs4i_viscosity_of(const gs4i_material_constants *mat, gs4_real T, gs4i_gradient L,
                                  int n)
{
    gs4_real sum = 0, rate;
    int i, j;
    if (mat->varies == GS4I_IN_LANES) return gs4i_herschel_bulkley_of(mat, L, n);
    for (j = 0; j < 3; j++)
        for (i = 0; i < 3; i++) {
            const gs4_real d = GS4I_NTH(L[i][j], n) + GS4I_NTH(L[j][i], n);
            sum += d * d;
        }
    rate = GS4I_SQRT(GS4I_C(0.5) * sum);
    if (!mat->varies) return mat->is.viscosity;
    return mat->viscosity_fn ? mat->viscosity_fn(T, rate, mat->viscosity_user)
                             : gs4i_cross_wlf(&mat->is, T, rate);
}

/* What follows from the material alone: the constants of Cross-WLF where none are given,
 * and both parts of viscosity. */
static void gs4i_set_material_constants(gs4i_material_constants *l, gs4_real temperature)
{
    gs4_material *m = &l->is;
    const int elastic = m->liquid != GS4_NEWTONIAN;
    if (gs4i_is_default_cross_wlf(m)) {
        m->cross_wlf.a = GS4I_C(5.66e3);
        m->cross_wlf.n = GS4I_C(-0.75);
        m->cross_wlf.d1 = GS4I_C(3.32e9);
        m->cross_wlf.a1 = GS4I_C(20.194);
        m->cross_wlf.t1 = 100;
        m->cross_wlf.t2 = GS4I_C(48.4);
    }
    l->density = m->density;
    l->inv_density = 1 / m->density;
    l->varies = m->viscosity_law == GS4_VISCOSITY_HERSCHEL_BULKLEY ? GS4I_IN_LANES
                : m->viscosity_law != GS4_VISCOSITY_CONSTANT       ? GS4I_BY_CALL
                                                                   : 0;
    l->viscosity_fn = m->viscosity_law == GS4_VISCOSITY_CALLBACK ? m->viscosity_fn : NULL;
    l->viscosity_user = m->viscosity_user;
    l->temperature = temperature;
    l->local = elastic ? m->local_fraction : 1;
    l->viscosity =
        l->varies == GS4I_IN_LANES ? m->herschel_bulkley.consistency : l->local * m->viscosity;
    l->inv_lambda = elastic ? 1 / m->relaxation_time : 0;
    l->modulus = elastic ? (1 - l->local) * m->viscosity / m->relaxation_time : 0;
    l->stretch = m->liquid == GS4_POM_POM ? 2 * m->relaxation_time / m->stretch_time : 0;
    l->nu = m->liquid == GS4_POM_POM ? 2 / m->arms : 0;
    l->alpha = m->liquid == GS4_POM_POM ? m->anisotropy : 0;
    l->shear_modulus = m->solid != GS4_NO_SOLID && !m->can_melt ? m->shear_modulus : 0;
    l->low = m->yield_compression > 0 ? 1 - m->yield_compression : 1 / GS4I_MOST_STRETCH;
    l->high = m->yield_stretch > 0 ? 1 + m->yield_stretch : GS4I_MOST_STRETCH;
    l->capacity = m->heat_capacity;
    l->conductivity = m->conductivity;
    l->flux_time = m->flux_relaxation_time;
    l->fourier = l->flux_time > 0 ? m->fourier_fraction : 1;
    l->reach = l->flux_time > 0 ? GS4I_SQRT(l->conductivity * l->inv_density / l->capacity)
                                      * GS4I_SQRT(l->flux_time)
                                : GS4I_C(0);
    l->melting = m->can_melt                ? m->melting_temperature
                 : m->solid == GS4_NO_SOLID ? -4 * GS4I_HUGE
                                            : 4 * GS4I_HUGE;
    l->latent = m->latent_heat > 0 ? m->latent_heat / m->heat_capacity : 0;
}

/* Of the solid phase, from that of the liquid one: the stress of F with the same pressure, in
 * place of all stress of liquids. A material that melts but is no solid flows in both phases. */
static void gs4i_set_solid_phase(gs4i_material_constants *l)
{
    if (!l->is.can_melt || l->is.solid == GS4_NO_SOLID) return;
    l->shear_modulus = l->is.shear_modulus;
    l->viscosity = l->inv_lambda = l->modulus = l->stretch = l->nu = l->alpha = 0;
    l->local = 0;
    l->varies = 0;
}

/* Six numbers of a symmetric tensor: xx yy zz xy xz yz. */
typedef gs4i_lanes gs4i_symmetric[6];

/* Cauchy stress (Pa, tension positive) but for the non-local part: -p I + 2 F_v mu D, and F_v
 * mu. */
GS4I_INLINE void gs4i_liquid_stress(const gs4i_batch_constants *l, const gs4i_wide *J,
                                    gs4i_gradient L, gs4i_symmetric sigma, gs4i_wide *mu)
{
    int b;
    GS4I_BATCH_LOOP(b) mu[b] = l->viscosity[b];
    if (l->varies & GS4I_IN_LANES) gs4i_herschel_bulkley(l->of, L, mu);
    for (b = 0; b < GS4I_BATCH && l->varies & GS4I_BY_CALL; b++)
        if (l->of[b]->varies == GS4I_BY_CALL)
            GS4I_NTH(mu, b) =
                l->of[b]->local
                * gs4i_viscosity_of(l->of[b], GS4I_NTH_CONST(l->temperature, b), L, b);
    GS4I_BATCH_LOOP(b) {
        gs4i_wide p;
        gs4i_pressure(&l->tait[b], &J[b], &p);
        sigma[0][b] = mu[b] * (L[0][0][b] + L[0][0][b]) - p;
        sigma[1][b] = mu[b] * (L[1][1][b] + L[1][1][b]) - p;
        sigma[2][b] = mu[b] * (L[2][2][b] + L[2][2][b]) - p;
        sigma[3][b] = mu[b] * (L[0][1][b] + L[1][0][b]);
        sigma[4][b] = mu[b] * (L[0][2][b] + L[2][0][b]);
        sigma[5][b] = mu[b] * (L[1][2][b] + L[2][1][b]);
    }
}

/* Liquids to start from: density (kg/m^3) and viscosity (Pa s) near the temperature given; of
 * viscoelastic ones also the local fraction, the relaxation and stretch times (s), anisotropy
 * and arms. */
static const struct gs4i_preset_row {
    const char *name;
    double density, viscosity;
    gs4_liquid liquid;
    double local, relaxation, stretch, anisotropy, arms;
} gs4i_presets[] = {
    /* 20 C; Kestin, Sokolov & Wakeham, J. Phys. Chem. Ref. Data 7 (1978) 941 */
    { "water", 998.2, 1.002e-3, GS4_NEWTONIAN, 0, 0, 0, 0, 0 },
    /* 20 C; Fellows, Food Processing Technology (2000), table 1.6 */
    { "olive oil", 911, 0.084, GS4_NEWTONIAN, 0, 0, 0, 0, 0 },
    /* 20 C; Segur & Oberstar, Ind. Eng. Chem. 43 (1951) 2117 */
    { "glycerol", 1261, 1.41, GS4_NEWTONIAN, 0, 0, 0, 0, 0 },
    /* 20-25 C, 17 % water; Yanniotis, Skaltsi & Karaburnioti, J. Food Eng. 72 (2006) 372 */
    { "honey", 1420, 10, GS4_NEWTONIAN, 0, 0, 0, 0, 0 },
    /* shaving foam; "GS4 viscoelastic MPM" (2021), table 4, coiling 3 */
    { "cream", 1000, 3063, GS4_POM_POM, 0.02, 12.25, 11.025, 1, 16 },
    /* the same, buckling 2 */
    { "ice cream", 1000, 3063, GS4_POM_POM, 0.01, 3.0625, 2.7563, 0.01, 16 },
    /* the same, coiling 2: elastic, not shear thinning */
    { "boger fluid", 1000, 3063, GS4_OLDROYD_B, 0.02, 12.25, 0, 0, 0 },
    /* low-density polyethylene at 170 C: third mode of Verbeeten, Peters & Baaijens, J. Rheology
     * 45 (2001) 823, table II, the two faster ones as local viscosity */
    { "polymer melt", 760, 2769, GS4_POM_POM, 0.394, 0.50349, 0.16783, 0.15, 2 }
};

/* What melts: viscosity (Pa s) of the liquid, shear modulus (Pa) and yield of the solid, c
 * (J/(kg K)), k (W/(m K)), T_m (degrees Celsius), L (J/kg). Heat is as measured, within some 10
 * % and over the range in which each really melts. Solids are softer than real ones by a factor
 * of 10 to 1e5, so that a step of the explicit scheme is not ruled by their sound: raise
 * shear_modulus where stiffness matters. */
static const struct gs4i_melt_row {
    const char *name;
    double density, viscosity;
    gs4_solid solid;
    double modulus, compression, stretch, capacity, conductivity, melting, latent;
} gs4i_melts[] = {
    /* dark; Beckett, Science of Chocolate (2008): viscosity, c, L */
    { "chocolate", 1270, 3, GS4_FIXED_COROTATED, 2e4, 0.05, 0.05, 1600, 0.25, 34, 4.5e4 },
    /* paraffin; Ukrainczyk, Kurajica & Sipusic (2010): c, k, L */
    { "wax", 900, 0.05, GS4_FIXED_COROTATED, 2e4, 0.05, 0.05, 2500, 0.24, 56, 2e5 },
    /* Rao, Rizvi & Datta, Engineering Properties of Foods: c, k */
    { "butter", 911, 0.05, GS4_FIXED_COROTATED, 1e4, 0.02, 0.02, 2400, 0.2, 32, 8e4 },
    /* basalt, molten at 1130 C; Shaw (1969): viscosity; Lange and others (1994): c, L */
    { "lava", 2600, 1000, GS4_NEO_HOOKEAN, 1e5, 0.05, 0.05, 1150, 1.5, 1070, 4e5 }
};

/* What stands still under its yield stress (Pa): consistency (Pa s^index) and index, near 20 C.
 * Makes and batches differ by a factor of two and more. Where no measurement is named they are
 * from the middle of usual ranges: fit to start from, not to compare with. */
static const struct gs4i_paste_row {
    const char *name;
    double density, yield, consistency, index;
} gs4i_pastes[] = {
    /* Koocheki and others, Int. J. Food Sci. Technol. 44 (2009) 596: consistency 6.6 to 20, index
     * 0.22 to 0.26; 0.4 Pa s at 236 1/s (NETZSCH); yield stresses are 10 to 35 */
    { "ketchup", 1140, 15, 18, 0.26 },
    /* low-fat, 14 days old, 4 C; Ramchandran & Shah, Dairy Sci. Technol. 89 (2009) 583, table VI */
    { "yoghurt", 1030, 15.28, 2.33, 0.65 },
    /* full-fat; usual range 40 to 120, 20 to 60, 0.25 to 0.45 */
    { "mayonnaise", 920, 80, 40, 0.35 },
    /* usual range 80 to 250, 30 to 120, 0.3 to 0.5 */
    { "toothpaste", 1300, 150, 60, 0.4 },
    /* clay and silt in water; the usual index is near 1/3, the rest changes a hundredfold with the
     * water in it: O'Brien & Julien, J. Hydraul. Eng. 114 (1988) 877 */
    { "mud", 1500, 30, 15, 0.33 },
    /* latex, for walls; usual range 1 to 10, 1 to 10, 0.5 to 0.7 */
    { "paint", 1300, 5, 5, 0.6 },
    /* 37 C; yield stress: Kim and others, J. Mech. Sci. Technol. 23 (2009) 1718; with it within 16
     * % of Carreau's law of Cho & Kensey, Biorheology 28 (1991) 241, from 1 to 1000 1/s */
    { "blood", 1060, 0.0175, 0.0075, 0.9 }
};

static int gs4i_preset(const char *name, gs4_material *m)
{
    size_t i;
    for (i = 0; i < sizeof gs4i_pastes / sizeof gs4i_pastes[0]; i++) {
        const struct gs4i_paste_row *p = &gs4i_pastes[i];
        if (strcmp(name, p->name) != 0) continue;
        memset(m, 0, sizeof *m);
        m->density = GS4I_C(p->density);
        m->viscosity_law = GS4_VISCOSITY_HERSCHEL_BULKLEY;
        m->herschel_bulkley.yield_stress = GS4I_C(p->yield);
        m->herschel_bulkley.consistency = GS4I_C(p->consistency);
        m->herschel_bulkley.index = GS4I_C(p->index);
        m->herschel_bulkley.creep_rate = GS4I_C(0.1);
        return GS4_OK;
    }
    for (i = 0; i < sizeof gs4i_presets / sizeof gs4i_presets[0]; i++) {
        const struct gs4i_preset_row *p = &gs4i_presets[i];
        if (strcmp(name, p->name) != 0) continue;
        memset(m, 0, sizeof *m);
        m->density = GS4I_C(p->density);
        m->viscosity = GS4I_C(p->viscosity);
        m->liquid = p->liquid;
        m->local_fraction = GS4I_C(p->local);
        m->relaxation_time = GS4I_C(p->relaxation);
        m->stretch_time = GS4I_C(p->stretch);
        m->anisotropy = GS4I_C(p->anisotropy);
        m->arms = GS4I_C(p->arms);
        return GS4_OK;
    }
    for (i = 0; i < sizeof gs4i_melts / sizeof gs4i_melts[0]; i++) {
        const struct gs4i_melt_row *p = &gs4i_melts[i];
        if (strcmp(name, p->name) != 0) continue;
        memset(m, 0, sizeof *m);
        m->density = GS4I_C(p->density);
        m->viscosity = GS4I_C(p->viscosity);
        m->solid = p->solid;
        m->shear_modulus = GS4I_C(p->modulus);
        m->yield_compression = GS4I_C(p->compression);
        m->yield_stretch = GS4I_C(p->stretch);
        m->heat_capacity = GS4I_C(p->capacity);
        m->conductivity = GS4I_C(p->conductivity);
        m->can_melt = 1;
        m->melting_temperature = GS4I_C(p->melting);
        m->latent_heat = GS4I_C(p->latent);
        return GS4_OK;
    }
    return GS4_ERROR_ARGUMENT;
}

/* ==== [[viscoelastic]] the non-local stress: UCM, Oldroyd-B, extended Pom-Pom ================== *
 *
 * Equation (5) of the manual for the Cauchy stress s, Pa (Verbeeten, Peters & Baaijens 2001). Below
 * S = s/G0, r = lambda_b/lambda_0s, nu = 2/Q.
 *
 *     ds/dt = L s + s L^T + 2 G0 D - [f s + G0 (f - 1) I + (alpha/G0) s.s] / lambda_b
 *     f = 2 r exp(nu (Lam - 1)) (1 - 1/Lam) + (1 - alpha tr(S.S)/3) / Lam^2,
 *     Lam = sqrt(1 + tr S/3);   Oldroyd-B: f = 1, alpha = 0
 *
 * The conformation c = S + I is positive definite: its eigenvalues are squares of stretches. There
 * are two integrators, both of second order. Where the step resolves the material, rule (4) in
 * lanes, with the relaxation f s implicit (gs4i_resolved). Elsewhere the split, particle by
 * particle, which keeps c positive definite by construction:
 *     UCM, Oldroyd-B    one linear map, exact for constant L (gs4i_linear_advance)
 *     pom-pom           c <- E c E^T, E = exp(L h), between two half relaxations
 *                       dc/dt = -[f c - I + alpha (c - I)^2] / lambda_b, in substeps h
 * An eigenvalue near 0 relaxes at (1 - alpha)/lambda_b. So for alpha > 1 the model leaves the cone
 * of positive conformations in finite time. With f = 1 all below 1 - 1/alpha fall. Then, and only
 * then, eigenvalues there relax without the term of alpha, none relaxes to less, and none is above
 * 1e6, chosen. How often is counted (tests/test_stress.c: stress_bounded). */

/* What the particles of a batch need of their materials. */
typedef struct gs4i_elastic_constants {
    gs4i_lanes modulus, inv_lambda, stretch /* 2 r; 0: f = 1 */, nu, alpha, temperature;
    const gs4i_material_constants *of[GS4I_BATCH];
    int pom_pom, varies; /* some of those seen so far are, or do */
} gs4i_elastic_constants;

/* Of one batch: stress and its rate, Pa and Pa/s. */
typedef struct gs4i_elastic {
    gs4i_symmetric s, rate;
} gs4i_elastic;

enum {
    GS4I_XX,
    GS4I_YY,
    GS4I_ZZ,
    GS4I_XY,
    GS4I_XZ,
    GS4I_YZ
};
static const int gs4i_place[3][3] = { { GS4I_XX, GS4I_XY, GS4I_XZ },
                                      { GS4I_XY, GS4I_YY, GS4I_YZ },
                                      { GS4I_XZ, GS4I_YZ, GS4I_ZZ } };

static void gs4i_load_elastic_constants(const gs4i_batch_constants *constants,
                                        gs4i_elastic_constants *l)
{
    int n;
    memcpy(l->temperature, constants->temperature, sizeof l->temperature);
    for (n = 0; n < GS4I_BATCH; n++) {
        const gs4i_material_constants *mat = constants->of[n];
        if (mat == l->of[n]) continue;
        l->of[n] = mat;
        l->pom_pom |= mat->stretch > 0;
        l->varies |= mat->varies & GS4I_BY_CALL;
        GS4I_NTH(l->modulus, n) = mat->modulus;
        GS4I_NTH(l->inv_lambda, n) = mat->inv_lambda;
        GS4I_NTH(l->stretch, n) = mat->stretch;
        GS4I_NTH(l->nu, n) = mat->nu;
        GS4I_NTH(l->alpha, n) = mat->alpha;
    }
}

/* f1 = f - 1 without cancellation for small S; trace3 = tr S/3, squares = tr S.S, stretch = 2 r.
 * How fast Lam^2 relaxes, in 1/lambda_b: stiff = 2 r exp(nu (Lam - 1)) (1 + nu |Lam - 1|).
 * Exponents are at most 300 and Lam^2 at least 1e-30, so that no number overflows. */
GS4I_INLINE void gs4i_pom_pom(double stretch, double nu, double alpha, double trace3,
                              double squares, double *f1, double *stiff)
{
    const double L2 = trace3 > -1 ? 1 + trace3 : 1e-30, Lam = sqrt(L2),
                 long_by = trace3 / (Lam + 1);
    const double e = stretch * exp(nu * long_by < 300 ? nu * long_by : 300);
    *f1 = e * long_by / Lam - (trace3 + alpha * squares / 3) / L2;
    *stiff = e * (1 + nu * fabs(long_by));
}

/* The right-hand side R of (5), Pa/s. relax = f / lambda_b is taken implicitly; stiff is how fast
 * the rest goes at most, by the stretch and by alpha. Both in 1/s. */
static void gs4i_elastic_rate(const gs4i_elastic_constants *l, gs4i_lanes G, gs4i_symmetric s,
                              gs4i_gradient L, gs4i_symmetric R, gs4i_lanes relax, gs4i_lanes stiff)
{
    gs4i_symmetric S, SS;
    gs4i_lanes trace3, squares, f1;
    int b, n, c, i, j, k;
    GS4I_BATCH_LOOP(b) {
        gs4i_wide inverse = G[b] - G[b];
        GS4I_CHOOSE(inverse, G[b] > GS4I_TINY, GS4I_C(1) / G[b], inverse);
        for (c = 0; c < 6; c++) S[c][b] = s[c][b] * inverse;
        trace3[b] = (S[0][b] + S[1][b] + S[2][b]) * GS4I_C(1.0 / 3);
        for (i = 0; i < 3; i++)
            for (j = i; j < 3; j++)
                SS[gs4i_place[i][j]][b] = S[gs4i_place[i][0]][b] * S[gs4i_place[0][j]][b]
                                          + S[gs4i_place[i][1]][b] * S[gs4i_place[1][j]][b]
                                          + S[gs4i_place[i][2]][b] * S[gs4i_place[2][j]][b];
        squares[b] = SS[0][b] + SS[1][b] + SS[2][b];
        f1[b] = trace3[b] - trace3[b];
        stiff[b] = f1[b];
    }
    for (n = 0; n < GS4I_BATCH && l->pom_pom; n++)
        if (GS4I_NTH_CONST(l->stretch, n) > 0) {
            double own, fast;
            gs4i_pom_pom((double)GS4I_NTH_CONST(l->stretch, n), (double)GS4I_NTH_CONST(l->nu, n),
                         (double)GS4I_NTH_CONST(l->alpha, n), (double)GS4I_NTH(trace3, n),
                         (double)GS4I_NTH(squares, n), &own, &fast);
            GS4I_NTH(f1, n) = GS4I_C(own);
            GS4I_NTH(stiff, n) = GS4I_C(fast
                                        + (double)GS4I_NTH_CONST(l->alpha, n) * 2
                                              * (1 + sqrt((double)GS4I_NTH(squares, n))));
        }
    GS4I_BATCH_LOOP(b) {
        relax[b] = l->inv_lambda[b] * (f1[b] + GS4I_C(1));
        stiff[b] *= l->inv_lambda[b];
        for (i = 0; i < 3; i++)
            for (j = i; j < 3; j++) {
                const int ij = gs4i_place[i][j];
                gs4i_wide sum = G[b] * (L[i][j][b] + L[j][i][b]) - relax[b] * s[ij][b]
                                - l->inv_lambda[b] * l->alpha[b] * G[b] * SS[ij][b];
                if (i == j) sum -= l->inv_lambda[b] * G[b] * f1[b];
                for (k = 0; k < 3; k++)
                    sum +=
                        L[i][k][b] * s[gs4i_place[k][j]][b] + L[j][k][b] * s[gs4i_place[k][i]][b];
                R[ij][b] = sum;
            }
    }
}

/* --- the split -------------------------------------------------------------------------------- */

/* Of one particle, in double. */
typedef struct gs4i_split {
    double inv_lambda, stretch, nu, alpha, L[3][3],
        swing /* bound of how far f h / lambda_b moves within a relaxation */;
    int bounded, substeps;
} gs4i_split;

/* Eigenvalues and eigenvectors (columns of Q) of a symmetric matrix, by Jacobi's rotations. They
 * converge quadratically, in a few of the twenty sweeps. */
static void gs4i_eigen(const double m[6], double values[3], double Q[3][3])
{
    double a[3][3];
    int i, j, k, p, q, sweep;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            a[i][j] = m[gs4i_place[i][j]];
            Q[i][j] = i == j;
        }
    for (sweep = 0; sweep < 20 && fabs(a[0][1]) + fabs(a[0][2]) + fabs(a[1][2]) > 0; sweep++)
        for (p = 0; p < 2; p++)
            for (q = p + 1; q < 3; q++) {
                const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                double t, cosine, sine;
                if (fabs(a[p][q]) <= 1e-18 * sqrt(fabs(a[p][p] * a[q][q]))) {
                    a[p][q] = a[q][p] = 0;
                    continue;
                }
                t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
                cosine = 1 / sqrt(t * t + 1);
                sine = t * cosine;
                for (k = 0; k < 3; k++) {
                    const double x = a[k][p], y = a[k][q];
                    a[k][p] = cosine * x - sine * y;
                    a[k][q] = sine * x + cosine * y;
                }
                for (k = 0; k < 3; k++) {
                    const double x = a[p][k], y = a[q][k];
                    a[p][k] = cosine * x - sine * y;
                    a[q][k] = sine * x + cosine * y;
                }
                for (k = 0; k < 3; k++) {
                    const double x = Q[k][p], y = Q[k][q];
                    Q[k][p] = cosine * x - sine * y;
                    Q[k][q] = sine * x + cosine * y;
                }
            }
    for (i = 0; i < 3; i++) values[i] = a[i][i];
}

/* f of the conformation m, and `stiff` of gs4i_pom_pom */
static double gs4i_relaxation(const gs4i_split *p, const double m[6], double *stiff)
{
    const double x = m[0] - 1, y = m[1] - 1, z = m[2] - 1;
    double f1;
    gs4i_pom_pom(p->stretch, p->nu, p->alpha, (x + y + z) / 3,
                 x * x + y * y + z * z + 2 * (m[3] * m[3] + m[4] * m[4] + m[5] * m[5]), &f1, stiff);
    return f1 + 1;
}

/* Is the smallest eigenvalue more than what rounding of the largest makes of it? By det / (sum of
 * principal minors), which is a third of it to all of it. 1e-11, chosen, is 1e5 roundings. */
static int gs4i_is_round(const double m[6])
{
    const double minors =
        (m[0] * m[1] - m[3] * m[3]) + (m[0] * m[2] - m[4] * m[4]) + (m[1] * m[2] - m[5] * m[5]);
    const double det = m[0] * (m[1] * m[2] - m[5] * m[5]) - m[3] * (m[3] * m[2] - m[5] * m[4])
                       + m[4] * (m[3] * m[5] - m[1] * m[4]);
    return minors > 0 && det > 1e-11 * (m[0] + m[1] + m[2]) * minors;
}

/* Relaxation with f fixed, t in units of lambda_b, for alpha in [0, 1]:
 *     dc/dt = -[alpha c^2 + (f - 2 alpha) c - (1 - alpha) I]
 * That is Riccati's equation. Its solution is c = u v^-1 of the linear
 *     (u, v)' = [[-g, 1 - alpha], [alpha, g]] (u, v),   g = f/2 - alpha,
 * whose exponential e has no negative entry. So (e00 c + e01)(e10 c + e11)^-1 is exact, and
 * positive definite as c is. */
static void gs4i_relax_fixed(double alpha, double f, double t, const double c[6], double to[6])
{
    const double g = 0.5 * f - alpha, w = sqrt(g * g + alpha * (1 - alpha));
    double e00 = 1 - g * t, e11 = 1 + g * t, grown = t, d[6], inverse[6], det;
    int i, j, k;
    if (w * t > 1e-9) { /* else its series; e times exp(-w t), which cancels */
        const double q = exp(-2 * w * t), more = 1 + fabs(g) / w,
                     less = alpha * (1 - alpha) / (w * (w + fabs(g)));
        e00 = 0.5 * (g > 0 ? less + q * more : more + q * less);
        e11 = 0.5 * (g > 0 ? more + q * less : less + q * more);
        grown = -expm1(-2 * w * t) / (2 * w);
    }
    for (i = 0; i < 6; i++) d[i] = alpha * grown * c[i] + (i < 3 ? e11 : 0);
    inverse[0] = d[1] * d[2] - d[5] * d[5];
    inverse[3] = d[4] * d[5] - d[3] * d[2];
    inverse[4] = d[3] * d[5] - d[4] * d[1];
    inverse[1] = d[0] * d[2] - d[4] * d[4];
    inverse[5] = d[3] * d[4] - d[0] * d[5];
    inverse[2] = d[0] * d[1] - d[3] * d[3];
    det = d[0] * inverse[0] + d[3] * inverse[3] + d[4] * inverse[4];
    for (i = 0; i < 3; i++)
        for (j = i; j < 3; j++) {
            double sum = (1 - alpha) * grown * inverse[gs4i_place[i][j]];
            for (k = 0; k < 3; k++) sum += e00 * c[gs4i_place[i][k]] * inverse[gs4i_place[k][j]];
            to[gs4i_place[i][j]] = sum / det;
        }
}

/* The same for alpha > 1, and where rounding could make an eigenvalue negative. Each goes by
 * itself: dc/dt = -(g c - (1 - alpha)), g = f + alpha (c - 2) at `now`, fixed too. For alpha > 1 it
 * stays in the bounds, of which the lower is taken at 0.999, chosen. */
static void gs4i_relax_values(gs4i_split *p, double f, double t, const double now[3],
                              const double c[3], double next[3])
{
    int k;
    for (k = 0; k < 3; k++) {
        const double lost = p->alpha > 1 ? 1 - 1 / p->alpha : 0,
                     alpha = now[k] < lost ? 0 : p->alpha;
        const double g = f + alpha * (now[k] - 2), x = g * t,
                     phi = fabs(x) < 1e-9 ? 1 - 0.5 * x : -expm1(-x) / x;
        next[k] = c[k] * exp(-x) + (1 - alpha) * t * phi;
        if (!(p->alpha > 1)) continue;
        if (alpha > 1 && !(next[k] >= 0.999 * lost)) {
            next[k] = 0.999 * lost;
            p->bounded = 1;
        }
        if (alpha < p->alpha || next[k] > 1e6) p->bounded = 1;
        if (next[k] > 1e6) next[k] = 1e6;
    }
}

/* Q diag(values) Q^T */
static void gs4i_recompose(double Q[3][3], const double values[3], double m[6])
{
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = i; j < 3; j++)
            m[gs4i_place[i][j]] = Q[i][0] * values[0] * Q[j][0] + Q[i][1] * values[1] * Q[j][1]
                                  + Q[i][2] * values[2] * Q[j][2];
}

/* Relaxes for the time h by the midpoint rule: with f fixed half the way, then all the way with f
 * from there. */
static void gs4i_relax(gs4i_split *p, double m[6], double h)
{
    const double t = h * p->inv_lambda;
    double half[6] = { 0, 0, 0, 0, 0, 0 }, c[6] = { 0, 0, 0, 0, 0, 0 }, next[3], Q[3][3], before,
           stiff;
    int i;
    /* at rest */
    if (m[0] == 1 && m[1] == 1 && m[2] == 1 && m[3] == 0 && m[4] == 0 && m[5] == 0) return;
    if (p->alpha <= 1 && gs4i_is_round(m)) {
        memcpy(c, m, sizeof c);
        gs4i_relax_fixed(p->alpha, gs4i_relaxation(p, c, &before), 0.5 * t, c, half);
        gs4i_relax_fixed(p->alpha, gs4i_relaxation(p, half, &stiff), t, c, m);
    } else {
        gs4i_eigen(m, c, Q);
        /* rounding of a thin ellipsoid */
        for (i = 0; i < 3; i++) c[i] = c[i] > 0 ? c[i] : 1e-30;
        gs4i_relax_values(p, gs4i_relaxation(p, c, &before), 0.5 * t, c, c, half);
        gs4i_relax_values(p, gs4i_relaxation(p, half, &stiff), t, half, c, next);
        gs4i_recompose(Q, next, m);
    }
    p->swing = fmax(p->swing, (fabs(stiff - before) + 2 * stiff) * t);
}

static void gs4i_multiply3(double a[3][3], double b[3][3], double r[3][3])
{
    double out[3][3];
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            out[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
    memcpy(r, out, sizeof out);
}

/* exp(L h): Taylor's series of A = L h / 2^n, entries of at most 1/8, squared n times. Ten terms
 * leave (3/8)^11/11! = 5e-13 at most. */
static void gs4i_exponential(double L[3][3], double h, double E[3][3])
{
    double A[3][3], term[3][3], size = 0;
    int i, j, k, n = 0;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            if (fabs(L[i][j] * h) > size) size = fabs(L[i][j] * h);
    while (size > 0.125 && n < 1000) {
        size *= 0.5;
        n++;
    }
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            A[i][j] = ldexp(L[i][j] * h, -n);
            term[i][j] = E[i][j] = i == j;
        }
    for (k = 1; k <= 10; k++) {
        gs4i_multiply3(term, A, term);
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) {
                term[i][j] /= k;
                E[i][j] += term[i][j];
            }
    }
    for (k = 0; k < n; k++) gs4i_multiply3(E, E, E);
}

/* c <- E c E^T */
static void gs4i_convect(double E[3][3], double m[6])
{
    double c[3][3], T[3][3];
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) c[i][j] = m[gs4i_place[i][j]];
    gs4i_multiply3(E, c, T);
    for (i = 0; i < 3; i++)
        for (j = i; j < 3; j++)
            m[gs4i_place[i][j]] = T[i][0] * E[j][0] + T[i][1] * E[j][1] + T[i][2] * E[j][2];
}

/* UCM and Oldroyd-B are linear: dS/dt = K S + S K^T + L + L^T, K = L - I/(2 lambda_b). So
 * S <- A S A^T + H, A = exp(K dt), exact for constant L. Both come by series over dt / 2^n, entries
 * of K dt / 2^n at most 1/64, and are doubled n times. Eight terms leave about 1e-14 of H. */
static void gs4i_linear_advance(const gs4i_split *p, double c[6], double dt)
{
    double K[3][3], A[3][3], M[3][3], T[3][3], H[6] = { 0, 0, 0, 0, 0, 0 }, values[3], size = 0,
                                               factor;
    int i, j, k, n = 0;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            K[i][j] = p->L[i][j] - (i == j ? 0.5 * p->inv_lambda : 0);
            M[i][j] = p->L[i][j] + p->L[j][i];
            size = fmax(size, fabs(K[i][j]) * dt);
        }
    while (size > 1.0 / 64 && n < 1000) {
        size *= 0.5;
        n++;
    }
    dt = ldexp(dt, -n);
    gs4i_exponential(K, dt, A);
    /* H = sum of dt^k/k! M_k, M_1 = L + L^T, M_(k+1) = K M_k + M_k K^T */
    for (k = 1, factor = dt; k <= 8; k++, factor *= dt / k) {
        for (i = 0; i < 3; i++)
            for (j = i; j < 3; j++) H[gs4i_place[i][j]] += factor * M[i][j];
        gs4i_multiply3(K, M, T);
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) M[i][j] = T[i][j] + T[j][i];
    }
    for (k = 0; k < n; k++) {
        double later[6];
        memcpy(later, H, sizeof later);
        gs4i_convect(A, later);
        for (i = 0; i < 6; i++) H[i] += later[i];
        gs4i_multiply3(A, A, A);
    }
    /* what rounding made negative of a thin ellipsoid: flow would draw it out */
    if (!gs4i_is_round(c)) {
        gs4i_eigen(c, values, T);
        for (i = 0; i < 3; i++) values[i] = values[i] > 0 ? values[i] : 0;
        gs4i_recompose(T, values, c);
    }
    for (i = 0; i < 3; i++) c[i] -= 1;
    gs4i_convect(A, c);
    for (i = 0; i < 6; i++) c[i] += H[i] + (i < 3);
}

/* Error of a substep, relative to S, measured: one call stays within 1e-3 of every row of the
 * reference (tests/test_stress.c: stress_split). With 1e-5 it missed one row. */
#define GS4I_SPLIT_TOLERANCE 5e-6
#define GS4I_SPLIT_LIMIT 20000 /* substeps, chosen; more means that nothing settles */

/* Conformation after the time dt under constant L. 0, or GS4_ERROR_UNSTABLE where it overflows or
 * takes too long. Substeps are of second order, so two halves are off by a third of their
 * difference from one whole. The next h goes by the cube root; 0.9, and factors from 0.1 to 4, are
 * chosen. */
static int gs4i_split_advance(gs4i_split *p, double c[6], double dt)
{
    /* longer than lambda_b one and two halves agree whatever they are: all has relaxed */
    double h = fmin(dt, 0.25 / p->inv_lambda), left = dt, E[3][3], half[3][3];
    int n, i;
    if (!(p->stretch > 0)) {
        gs4i_linear_advance(p, c, dt);
        left = 0;
    }
    for (n = 0; n < GS4I_SPLIT_LIMIT && left > 0; n++, p->substeps++) {
        double one[6], two[6], error = 0, change = 0, before = 0, after = 0, size, ratio;
        if (h > left * (1 - 1e-12)) h = left;
        gs4i_exponential(p->L, 0.5 * h, half);
        gs4i_multiply3(half, half, E);
        memcpy(one, c, sizeof one);
        memcpy(two, c, sizeof two);
        p->swing = 0;
        gs4i_relax(p, one, 0.5 * h);
        gs4i_convect(E, one);
        gs4i_relax(p, one, 0.5 * h);
        gs4i_relax(p, two, 0.25 * h);
        gs4i_convect(half, two);
        gs4i_relax(p, two, 0.5 * h);
        gs4i_convect(half, two);
        gs4i_relax(p, two, 0.25 * h);
        /* lengths that no rotation of the axes changes */
        for (i = 0; i < 6; i++) {
            const double weight = i < 3 ? 1 : 2, now = two[i] - (i < 3), then = c[i] - (i < 3);
            error += weight * (two[i] - one[i]) * (two[i] - one[i]);
            change += weight * (now - then) * (now - then);
            after += weight * now * now;
            before += weight * then * then;
        }
        error = sqrt(error) / 3;
        change = sqrt(change);
        size = fmax(1e-14, sqrt(fmax(before, after)));
        if (!(error < 1e145)) error = 1e290; /* NaN, too */
        /* where f swings, one and two halves may agree on a wrong answer */
        ratio = fmax(error / (GS4I_SPLIT_TOLERANCE * size + 2e-15 * (1 + size)), p->swing);
        if (ratio <= 1) {
            memcpy(c, two, sizeof two);
            left -= h;
            /* it has settled: what is left changes less than 1e-6 of S, chosen, or than rounding */
            if (h < left && (change * (left / h) < 1e-6 * size || change < 4e-15 * (1 + size)))
                return GS4_OK;
        }
        h *= ratio > 0.01 ? fmax(0.9 / cbrt(ratio), 0.1) : 4;
    }
    for (i = 0; i < 6; i++)
        if (!(fabs(c[i]) < 1e290)) return GS4_ERROR_UNSTABLE;
    return left > 0 ? GS4_ERROR_UNSTABLE : GS4_OK;
}

/* dc/dt = L c + c L^T - [f c - I + alpha (c - I)^2] / lambda_b */
static void gs4i_conformation_rate(const gs4i_split *p, const double c[6], double rate[6])
{
    double S[3][3], f1 = 0, stiff, squares = 0;
    int i, j, k;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            S[i][j] = c[gs4i_place[i][j]] - (i == j);
            squares += S[i][j] * S[i][j];
        }
    if (p->stretch > 0)
        gs4i_pom_pom(p->stretch, p->nu, p->alpha, (S[0][0] + S[1][1] + S[2][2]) / 3, squares, &f1,
                     &stiff);
    for (i = 0; i < 3; i++)
        for (j = i; j < 3; j++) {
            double sum = -p->inv_lambda * ((f1 + 1) * S[i][j] + (i == j ? f1 : 0));
            for (k = 0; k < 3; k++) {
                sum += p->L[i][k] * c[gs4i_place[k][j]] + p->L[j][k] * c[gs4i_place[k][i]]
                       - p->inv_lambda * p->alpha * S[i][k] * S[k][j];
            }
            rate[gs4i_place[i][j]] = sum;
        }
}

/* How many particles took the split, and how many of them had eigenvalues bounded. */
typedef struct gs4i_elastic_count {
    int split, bounded;
    int substeps;
    int failed, no_modulus; /* number in the batch, from 1, of one whose stress, G0 failed */
} gs4i_elastic_count;

/* A batch whose particles may need the split: constants, G0 (Pa), L, stress before, the time, and
 * gamma of (4) for the rate. */
typedef struct gs4i_split_batch {
    const gs4i_elastic_constants *constants;
    const gs4i_wide *G;
    gs4i_lanes *L;
    const gs4i_elastic *e;
    double dt, gamma;
} gs4i_split_batch;

static gs4i_split_batch gs4i_batch_to_split(const gs4i_elastic_constants *constants,
                                            const gs4i_wide *G, gs4i_gradient L,
                                            const gs4i_elastic *e, double dt)
{
    gs4i_split_batch batch;
    batch.constants = constants;
    batch.G = G;
    batch.L = L[0];
    batch.e = e;
    batch.dt = dt;
    batch.gamma = 1;
    return batch;
}

/* Particle n of a batch by the split over dt: its stress then, and with `rate` the rate that (4)
 * would have left. That belongs to (gamma - 1/2) dt before. The mean slope belongs to dt/2 before.
 * So 2 gamma - 1 of that and the rest of the slope at the end make it. */
static void gs4i_split_one(const gs4i_split_batch *batch, int n, gs4i_symmetric after,
                           gs4i_lanes *rate, gs4i_elastic_count *count)
{
    const gs4i_elastic_constants *l = batch->constants;
    const double modulus = (double)GS4I_NTH_CONST(batch->G, n), dt = batch->dt;
    double c[6], before[6], end[6], fast = 0, gap = 1e-290, slope;
    gs4i_split p;
    int i, j;
    p.inv_lambda = (double)GS4I_NTH_CONST(l->inv_lambda, n);
    p.stretch = (double)GS4I_NTH_CONST(l->stretch, n);
    p.nu = (double)GS4I_NTH_CONST(l->nu, n);
    p.alpha = (double)GS4I_NTH_CONST(l->alpha, n);
    p.bounded = p.substeps = 0;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) p.L[i][j] = (double)GS4I_NTH(batch->L[3 * i + j], n);
    for (i = 0; i < 6; i++)
        before[i] = c[i] = (double)GS4I_NTH_CONST(batch->e->s[i], n) / modulus + (i < 3);
    count->split++;
    if (gs4i_split_advance(&p, c, dt) != GS4_OK) count->failed = n + 1;
    for (i = 0; i < 6; i++) GS4I_NTH(after[i], n) = GS4I_C(modulus * (c[i] - (i < 3)));
    count->bounded += p.bounded;
    count->substeps += p.substeps;
    if (!rate) return;
    gs4i_conformation_rate(&p, c, end);
    for (i = 0; i < 6; i++) {
        fast = fmax(fast, fabs(end[i]));
        gap = fmax(gap, fabs((c[i] - before[i]) / dt - end[i]));
    }
    /* a transient that is over is no part of the rate: there the slope at the end alone */
    slope = (2 * batch->gamma - 1) * fmin(1, fast / gap);
    for (i = 0; i < 6; i++)
        GS4I_NTH(rate[i], n) =
            GS4I_C(modulus * (slope * (c[i] - before[i]) / dt + (1 - slope) * end[i]));
}

/* --- both together ---------------------------------------------------------------------------- */

/* Does rule (4) resolve each particle? Beside the border both integrators are of second order. So
 * most of it is chosen:
 *     |L| dt       < 1/4
 *     stiff dt     < 0.4: (4) is stable up to 0.48 or more, see gs4i_correct_elastic
 *     f dt/lambda_b    > -0.1, far from the pole at -1; in a first step < 1: there the factor
 *                  of the midpoint rule, (1 - z/2)/(1 + z/2), is negative from 2 on
 *     c            or for alpha > 1 c - (1 - 1/alpha) I, positive definite: its first entry above
 *                  1e-3, minors above 1e-5 of products of the diagonal, which float resolves */
static int gs4i_resolved(gs4i_lanes G, const gs4i_wide *alpha, gs4i_gradient L, gs4i_symmetric s,
                         gs4i_lanes relax, gs4i_lanes stiff, const gs4i_integrator *integrator,
                         int ok[GS4I_BATCH])
{
    const gs4_real dt = integrator->dt, fastest = integrator->restart ? 1 / dt : GS4I_HUGE;
    gs4i_lanes squared, verdict;
    int b, j, all = 1;
    gs4i_gradient_squared(L, squared);
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide zero = G[b] - G[b], one = zero + GS4I_C(1);
        gs4i_wide room, xx, yy, zz, minor, det;
        gs4i_wide_mask good;
        GS4I_WIDE_MAX(room, alpha[b], one);
        room = G[b] / room;
        xx = s[0][b] + room;
        yy = s[1][b] + room;
        zz = s[2][b] + room;
        minor = xx * yy - s[3][b] * s[3][b];
        det = zz * minor - s[4][b] * (s[4][b] * yy - s[3][b] * s[5][b])
              - s[5][b] * (xx * s[5][b] - s[3][b] * s[4][b]);
        good = ((squared[b] * (dt * dt) < GS4I_C(0.0625)) & (stiff[b] * dt < GS4I_C(0.4))
                & (relax[b] * dt > GS4I_C(-0.1)) & (relax[b] < fastest) & (xx > GS4I_C(1e-3) * G[b])
                & (minor > GS4I_C(1e-5) * xx * yy) & (det > GS4I_C(1e-5) * xx * yy * zz))
               | (G[b] <= GS4I_TINY);
        all &= gs4i_all(&good);
        GS4I_CHOOSE(verdict[b], good, one, zero);
    }
    for (j = 0; j < GS4I_BATCH && !all; j++) ok[j] = GS4I_NTH(verdict, j) > 0;
    return all;
}

/* G0 = (1 - F_v) mu / lambda_b of n particles, where mu depends on the shear rate of the mu there.
 * Where the callback gives no number G0 is 0, and no_modulus says so. */
static void gs4i_moduli(const gs4i_elastic_constants *l, gs4i_gradient L, int n, gs4i_lanes G,
                        gs4i_elastic_count *count)
{
    int b;
    memcpy(G, l->modulus, sizeof l->modulus);
    for (b = 0; b < n && l->varies; b++) {
        const gs4i_material_constants *mat = l->of[b];
        gs4_real mu, modulus;
        if (!mat->varies || !(mat->inv_lambda > 0)) continue;
        mu = gs4i_viscosity_of(mat, GS4I_NTH_CONST(l->temperature, b), L, b);
        modulus = (1 - mat->local) * mu * mat->inv_lambda;
        if (!(mu >= 0 && modulus < GS4I_HUGE)) {
            count->no_modulus = b + 1;
            modulus = 0;
        }
        GS4I_NTH(G, b) = modulus;
    }
}

/* S4: stress at the stage, s~ = s** + w (R + relax (s* - s~)), for n particles of the batch. */
static void gs4i_stage_elastic(const gs4i_elastic_constants *l, gs4i_lanes G, const gs4i_elastic *e,
                               const gs4i_integrator *integrator, gs4i_gradient L, int n,
                               gs4i_symmetric s, gs4i_elastic_count *count)
{
    const gs4_real ahead = integrator->prediction.ahead, w = integrator->s;
    gs4i_symmetric R;
    gs4i_lanes relax, stiff;
    gs4i_split_batch batch;
    int b, c, ok[GS4I_BATCH];
    for (c = 0; c < 6; c++)
        GS4I_BATCH_LOOP(b) s[c][b] = e->s[c][b] + ahead * e->rate[c][b];
    gs4i_elastic_rate(l, G, s, L, R, relax, stiff);
    for (c = 0; c < 6; c++)
        GS4I_BATCH_LOOP(b)
            s[c][b] =
                (e->s[c][b] + (ahead - w) * e->rate[c][b] + w * (R[c][b] + relax[b] * s[c][b]))
                / (GS4I_C(1) + w * relax[b]);
    if (gs4i_resolved(G, l->alpha, L, s, relax, stiff, integrator, ok)) return;
    batch = gs4i_batch_to_split(l, G, L, e, (double)ahead);
    for (b = 0; b < n && !count->failed; b++)
        if (!ok[b]) gs4i_split_one(&batch, b, s, NULL, count);
}

/* S7: s by rule (4) with implicit relaxation, for n particles of the batch. With
 * w = alpha_f gamma dt and s* = s + alpha_f dt s':
 *     (alpha_m + w relax) ds' = R(y) + relax (y - s*) - s'
 * y is s*; where there are no rates to predict with, that of the midpoint rule. Such a prediction
 * is stable up to stiff dt = 4 (1 - r s)/(3 + r + s - r s): at least 0.48 where gamma > 0.66, and 0
 * at 1/2. Members below 0.66 take y = s* + w ds' again, five times in all, chosen. */
static void gs4i_correct_elastic(const gs4i_elastic_constants *l, gs4i_elastic *e,
                                 const gs4i_integrator *integrator, gs4i_gradient L, int n,
                                 gs4i_elastic_count *count)
{
    const gs4_real dt = integrator->dt, w = integrator->alpha_f * integrator->gamma * dt;
    const gs4i_elastic old = *e;
    gs4i_symmetric star, y, R, change;
    gs4i_lanes G, relax, stiff;
    gs4i_split_batch batch;
    int b, c, ok[GS4I_BATCH], pass, passes = integrator->gamma > GS4I_C(0.66) ? 1 : 5;
    gs4i_moduli(l, L, n, G, count);
    if (count->no_modulus) return; /* tried before, where the callback is a function */
    for (c = 0; c < 6; c++)
        GS4I_BATCH_LOOP(b)
            star[c][b] = y[c][b] = e->s[c][b] + integrator->alpha_f * dt * e->rate[c][b];
    if (integrator->restart) {
        gs4i_elastic_rate(l, G, e->s, L, R, relax, stiff);
        for (c = 0; c < 6; c++)
            GS4I_BATCH_LOOP(b) y[c][b] += integrator->alpha_f * dt * R[c][b];
    }
    for (pass = 0; pass < passes; pass++) {
        gs4i_elastic_rate(l, G, y, L, R, relax, stiff);
        for (c = 0; c < 6; c++)
            GS4I_BATCH_LOOP(b) {
                change[c][b] = (R[c][b] + relax[b] * (y[c][b] - star[c][b]) - e->rate[c][b])
                               / (integrator->alpha_m + w * relax[b]);
                y[c][b] = star[c][b] + w * change[c][b];
            }
    }
    for (c = 0; c < 6; c++)
        GS4I_BATCH_LOOP(b) {
            e->s[c][b] = (e->s[c][b] + dt * e->rate[c][b]) + integrator->gamma * dt * change[c][b];
            e->rate[c][b] += change[c][b];
        }
    if (gs4i_resolved(G, l->alpha, L, e->s, relax, stiff, integrator, ok)) return;
    batch = gs4i_batch_to_split(l, G, L, &old, (double)dt);
    batch.gamma = (double)integrator->gamma;
    for (b = 0; b < n && !count->failed; b++)
        if (!ok[b]) gs4i_split_one(&batch, b, e->s, e->rate, count);
}

/* Density times the squared speed of elastic waves of each particle, Pa: 2 G0 c_max at most. The
 * largest row sum of c bounds its eigenvalues. */
static void gs4i_see_elastic(gs4i_lanes G, gs4i_symmetric s, gs4i_lanes stiffness)
{
    int b, i, j;
    GS4I_BATCH_LOOP(b) {
        gs4i_wide zero = G[b] - G[b], most = zero;
        for (i = 0; i < 3; i++) {
            gs4i_wide row = zero;
            for (j = 0; j < 3; j++) {
                const gs4i_wide x = s[gs4i_place[i][j]][b], minus = zero - x;
                gs4i_wide size;
                GS4I_WIDE_MAX(size, x, minus);
                row += size;
            }
            GS4I_WIDE_MAX(most, row, most);
        }
        stiffness[b] = GS4I_C(2) * (most + G[b]);
    }
}

/* Stress of n particles from memory, six numbers each and six of the rate where that is kept. */
static void gs4i_load_elastic(const gs4_real *from, int reals, int n, gs4i_elastic *e)
{
    gs4i_lanes *l = (gs4i_lanes *)(void *)e; /* 12 in the order of its fields */
    if (reals == 12)
        gs4i_numbers_to_lanes(from, 12, n, l);
    else {
        gs4i_numbers_to_lanes(from, 6, n, l);
        memset(l + 6, 0, 6 * sizeof *l);
    }
}

static void gs4i_store_elastic(gs4_real *to, int reals, int n, gs4i_elastic *e)
{
    gs4i_lanes *l = (gs4i_lanes *)(void *)e;
    if (reals == 12)
        gs4i_lanes_to_numbers(l, 12, n, to);
    else
        gs4i_lanes_to_numbers(l, 6, n, to);
}

/* ==== [[solid]] elastic and plastic solids: neo-Hookean, fixed-corotated ======================= *
 *
 * F is the elastic part of the deformation gradient, dF/dt = L F while nothing yields; F = V R
 * with a rotation R. Its Cauchy stress (Pa), equation (6), beside the pressure:
 *
 *     neo-Hookean      s = (G/J) dev(B),         B = J^(-2/3) F F^T                         (2021)
 *     fixed-corotated  s = (2 G/J) dev(B - V),   V^2 = B: energy G |J^(-1/3) F - R|^2  (2014, 7, 8)
 *
 * J of the particle alone is the volume: F is scaled to det F = J whenever it is written. Particles
 * of liquids have F = J^(1/3) I.
 *     What is kept with F is not dF/dt but M = (dF/dt) F^-1. M goes by (4) for known grad u, and F
 * by the mean of M over the step:
 *
 *     dM = (grad u - M) / alpha_m,   X = dt (M + gamma dM),   M += dM,
 *     F <- (I - X/2)^-1 (I + X/2) F
 *     stage: Y = alpha_f dt M + s (L~ - M),   F~ = (I - Y/2)^-1 (I + Y/2) F
 *
 * To first order in X that is (4) for F itself, implicit in F at the stage. But a rotation stays
 * one, whatever dt. Where |X| > 1 exp(X) takes the place of the fraction, so det F > 0 after any
 * step. Yielding, F <- F P, and forgetting all strain, F <- J^(1/3) I, change F from the right.
 * They leave M as it is, so nothing needs a restart.
 *     Yield (2014, 5.1), after each step: singular values of F are clamped to
 *     [1 - theta_c, 1 + theta_s], then all scaled to det F = J.
 *     Solids also keep their spin w (rad/s) with its rate: S3, gs4i_correct_spin. */

/* Density times squared speed of elastic waves, over G times the largest eigenvalue of B. A
 * continuum has 4/3 beside sound, by its acoustic tensor. The grid has less of div dev grad than of
 * div grad. Balls as in tests/test_solid.c (solid_stability) are stable at 0.95 of the limit with
 * 0.7 here, not with 0.6: 1 is chosen above that. */
#define GS4I_SOLID_WAVES GS4I_C(1)
/* |X| of one step, chosen; more is refused. Where |grad u| dt <= 1 it is about 1. */
#define GS4I_MOST_STRAIN GS4I_C(8)

/* What the particles of a batch need of their materials. */
typedef struct gs4i_solid_constants {
    gs4i_lanes modulus /* 0: not solid */, low, high, corotated /* 1 or 0 */;
    const gs4i_material_constants *of[GS4I_BATCH];
    /* solids in this batch; fixed-corotated ones among those seen so far */
    int present, any_corotated;
} gs4i_solid_constants;

/* F, M, w and dw/dt of a batch. */
typedef struct gs4i_deformation {
    gs4i_matrix F, rate;
    gs4i_lanes spin[3], spin_rate[3];
} gs4i_deformation;

/* How many particles took the exponential, how many had to be bounded; 1 + the place in the batch
 * of the last that could not be done. */
typedef struct gs4i_solid_count {
    int split, bounded, failed;
} gs4i_solid_count;

/* Returns whether any of the batch is solid. */
static int gs4i_load_solid_constants(const gs4i_batch_constants *constants, gs4i_solid_constants *l)
{
    int n;
    l->present = 0;
    for (n = 0; n < GS4I_BATCH; n++) {
        const gs4i_material_constants *mat = constants->of[n];
        l->present |= mat->shear_modulus > 0;
        if (mat == l->of[n]) continue;
        l->of[n] = mat;
        l->any_corotated |= mat->is.solid == GS4_FIXED_COROTATED;
        GS4I_NTH(l->modulus, n) = mat->shear_modulus;
        GS4I_NTH(l->low, n) = mat->low;
        GS4I_NTH(l->high, n) = mat->high;
        GS4I_NTH(l->corotated, n) = GS4I_C(mat->is.solid == GS4_FIXED_COROTATED);
    }
    return l->present;
}

/* --- one particle, in double ------------------------------------------------------------------ */

static double gs4i_dot3(double a[3][3], int i, double b[3][3], int j)
{
    return a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j];
}

/* Columns p and q of a become c p - s q and s p + c q. */
static void gs4i_turn_columns(double a[3][3], int p, int q, double cosine, double sine)
{
    int k;
    for (k = 0; k < 3; k++) {
        const double x = a[k][p], y = a[k][q];
        a[k][p] = cosine * x - sine * y;
        a[k][q] = sine * x + cosine * y;
    }
}

/* F = U diag(s) V^T with rotations U and V, s[0] >= s[1] >= |s[2]|, and the sign of det F in s[2].
 * F may be any that is finite, flat or zero too. One-sided Jacobi: the columns of F V are made
 * orthogonal, so that small singular values keep their digits. It converges quadratically, in a few
 * of the thirty sweeps. */
static void gs4i_svd(double F[3][3], double U[3][3], double s[3], double V[3][3])
{
    double A[3][3], size = 0, u[3][3];
    int i, j, p, q, sweep, turned = 1;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            size = fmax(size, fabs(F[i][j]));
            V[i][j] = i == j;
        }
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) A[i][j] = size > 0 ? F[i][j] / size : 0;
    for (sweep = 0; sweep < 30 && turned; sweep++)
        for (turned = 0, p = 0; p < 2; p++)
            for (q = p + 1; q < 3; q++) {
                const double a = gs4i_dot3(A, p, A, p), b = gs4i_dot3(A, q, A, q),
                             c = gs4i_dot3(A, p, A, q), zeta = 0.5 * (b - a) / c;
                double t, cosine;
                if (!(fabs(c) > 1e-16 * sqrt(a) * sqrt(b)) || !(fabs(zeta) < 1e150)) continue;
                t = (zeta >= 0 ? 1 : -1) / (fabs(zeta) + sqrt(1 + zeta * zeta));
                cosine = 1 / sqrt(1 + t * t);
                gs4i_turn_columns(A, p, q, cosine, cosine * t);
                gs4i_turn_columns(V, p, q, cosine, cosine * t);
                turned = 1;
            }
    /* a quarter turn puts the longer column first */
    for (sweep = 0; sweep < 3; sweep++)
        if (gs4i_dot3(A, sweep % 2, A, sweep % 2) < gs4i_dot3(A, sweep % 2 + 1, A, sweep % 2 + 1)) {
            gs4i_turn_columns(A, sweep % 2, sweep % 2 + 1, 0, -1);
            gs4i_turn_columns(V, sweep % 2, sweep % 2 + 1, 0, -1);
        }
    for (j = 0; j < 2; j++) {
        double length = sqrt(gs4i_dot3(A, j, A, j)), along;
        if (length > 1e-150)
            for (i = 0; i < 3; i++) u[i][j] = A[i][j] / length;
        /* any direction will do: the axis that is farthest from the first */
        else {
            const int axis = j == 0 ? 0 : fabs(u[0][0]) < 0.6 ? 0 : fabs(u[1][0]) < 0.75 ? 1 : 2;
            for (i = 0; i < 3; i++) u[i][j] = i == axis;
        }
        along = j ? gs4i_dot3(u, 0, u, 1) : 0;
        for (i = 0; i < 3 && j; i++) u[i][1] -= along * u[i][0];
        length = sqrt(gs4i_dot3(u, j, u, j));
        for (i = 0; i < 3; i++) u[i][j] /= length;
    }
    for (i = 0; i < 3; i++)
        u[i][2] = u[(i + 1) % 3][0] * u[(i + 2) % 3][1] - u[(i + 2) % 3][0] * u[(i + 1) % 3][1];
    for (j = 0; j < 3; j++) s[j] = size * gs4i_dot3(A, j, u, j);
    memcpy(U, u, sizeof u);
}

/* Deviatoric Cauchy stress, added to sigma, and what gs4i_solid_stress calls stiffness. */
static void gs4i_solid_stress_one(const gs4i_material_constants *mat, double F[3][3], double J,
                                  double sigma[6], double *stiffness)
{
    const double q = 1 / cbrt(J), G = (double)mat->shear_modulus;
    const int corotated = mat->is.solid == GS4_FIXED_COROTATED;
    double U[3][3], s[3], V[3][3], t[3], mean = 0, most = 0;
    int i, j, k;
    gs4i_svd(F, U, s, V);
    for (k = 0; k < 3; k++) {
        const double stretch = q * s[k];
        t[k] = corotated ? 2 * stretch * (stretch - 1) : stretch * stretch;
        mean += t[k] / 3;
        most = fmax(most, fabs(stretch));
    }
    for (i = 0; i < 3; i++)
        for (j = i; j < 3; j++)
            for (k = 0; k < 3; k++)
                sigma[gs4i_place[i][j]] += G / J * (t[k] - mean) * U[i][k] * U[j][k];
    *stiffness = (double)GS4I_SOLID_WAVES * G * (corotated ? most * (2 * most - 1) : most * most);
}

/* Clamp the singular values of F, scale to the determinant that it had. Were any beyond their
 * limits? */
static int gs4i_yield_one(double F[3][3], double low, double high)
{
    double U[3][3], s[3], V[3][3], clamped[3], scale;
    int i, j, k;
    gs4i_svd(F, U, s, V);
    for (k = 0; k < 3; k++) clamped[k] = fmin(fmax(s[k], low), high);
    if (clamped[0] == s[0] && clamped[1] == s[1] && clamped[2] == s[2]) return 0;
    scale = cbrt(s[0] / clamped[0] * (s[1] / clamped[1]) * (s[2] / clamped[2]));
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            for (F[i][j] = 0, k = 0; k < 3; k++)
                F[i][j] += U[i][k] * (scale * clamped[k]) * V[j][k];
    return 1;
}

static double gs4i_determinant(double F[3][3])
{
    return F[0][0] * (F[1][1] * F[2][2] - F[1][2] * F[2][1])
           + F[0][1] * (F[1][2] * F[2][0] - F[1][0] * F[2][2])
           + F[0][2] * (F[1][0] * F[2][1] - F[1][1] * F[2][0]);
}

/* F <- exp(X) F. Returns 0, and leaves F, where |X| > GS4I_MOST_STRAIN. */
static int gs4i_exponential_step(gs4i_matrix X, int n, double F[3][3])
{
    double x[3][3], E[3][3], squared = 0;
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) {
            x[i][j] = (double)GS4I_NTH(X[i][j], n);
            squared += x[i][j] * x[i][j];
        }
    if (!(squared <= (double)(GS4I_MOST_STRAIN * GS4I_MOST_STRAIN))) return 0;
    gs4i_exponential(x, 1, E);
    gs4i_multiply3(E, F, F);
    return 1;
}

static void gs4i_matrix_of(gs4i_matrix a, int n, double one[3][3])
{
    int i;
    for (i = 0; i < 9; i++) one[i / 3][i % 3] = (double)GS4I_NTH(a[i / 3][i % 3], n);
}

static void gs4i_set_matrix(gs4i_matrix a, int n, double one[3][3])
{
    int i;
    for (i = 0; i < 9; i++) GS4I_NTH(a[i / 3][i % 3], n) = GS4I_C(one[i / 3][i % 3]);
}

/* --- a batch ---------------------------------------------------------------------------------- */

/* Cube root to rounding for 1/20 < x < 20, positive for any positive x: Halley's rule, four
 * times from 1. */
GS4I_INLINE void gs4i_cube_root(const gs4i_wide *x, gs4i_wide *root)
{
    gs4i_wide y = (*x - *x) + GS4I_C(1);
    int i;
    for (i = 0; i < 4; i++) {
        const gs4i_wide y3 = y * y * y;
        y *= (y3 + *x + *x) / (y3 + y3 + *x);
    }
    *root = y;
}

/* Cofactors c of a: its inverse is their transpose over the determinant. */
GS4I_INLINE void gs4i_cofactors(gs4i_wide a[3][3], gs4i_wide c[3][3], gs4i_wide *determinant)
{
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            c[i][j] = a[(i + 1) % 3][(j + 1) % 3] * a[(i + 2) % 3][(j + 2) % 3]
                      - a[(i + 1) % 3][(j + 2) % 3] * a[(i + 2) % 3][(j + 1) % 3];
    *determinant = a[0][0] * c[0][0] + a[0][1] * c[0][1] + a[0][2] * c[0][2];
}

/* |X|^2 up to which the fraction serves, chosen: its pole is at 4. */
#define GS4I_SMALL_STEP GS4I_C(1)

/* Is |X| small for all? */
static int gs4i_is_small_step(gs4i_matrix X, gs4i_lanes squared)
{
    int b, small = 1;
    gs4i_gradient_squared(X, squared);
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide_mask fine = squared[b] < GS4I_SMALL_STEP;
        small &= gs4i_all(&fine);
    }
    return small;
}

/* now = (I - X/2)^-1 (I + X/2) F, as F + (I - X/2)^-1 X F, which rounds less; may be F itself. */
static void gs4i_deform(gs4i_matrix X, gs4i_matrix F, gs4i_matrix now)
{
    int b, i, j;
    GS4I_BATCH_LOOP(b) {
        gs4i_wide a[3][3], C[3][3], XF[3][3], inverse;
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) {
                a[i][j] = GS4I_C(-0.5) * X[i][j][b];
                if (i == j) a[i][j] += GS4I_C(1);
                XF[i][j] =
                    X[i][0][b] * F[0][j][b] + X[i][1][b] * F[1][j][b] + X[i][2][b] * F[2][j][b];
            }
        gs4i_cofactors(a, C, &inverse);
        inverse = GS4I_C(1) / inverse;
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++)
                now[i][j][b] =
                    F[i][j][b]
                    + inverse * (C[0][i] * XF[0][j] + C[1][i] * XF[1][j] + C[2][i] * XF[2][j]);
    }
}

/* The wide b of each of nine lanes */
GS4I_INLINE void gs4i_matrix_wide(gs4i_matrix from, int b, gs4i_wide to[3][3])
{
    int i;
    for (i = 0; i < 9; i++) to[i / 3][i % 3] = from[i / 3][i % 3][b];
}

/* B = F F^T, symmetric */
GS4I_INLINE void gs4i_left_cauchy_green(gs4i_wide F[3][3], gs4i_wide B[6])
{
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = i; j < 3; j++)
            B[gs4i_place[i][j]] = F[i][0] * F[j][0] + F[i][1] * F[j][1] + F[i][2] * F[j][2];
}

/* Is a symmetric matrix positive definite? By its leading minors. */
GS4I_INLINE void gs4i_is_positive(const gs4i_wide s[6], gs4i_wide_mask *positive)
{
    const gs4i_wide minor = s[0] * s[1] - s[3] * s[3];
    const gs4i_wide det =
        s[2] * minor - s[4] * (s[4] * s[1] - s[3] * s[5]) - s[5] * (s[0] * s[5] - s[3] * s[4]);
    *positive = (s[0] > GS4I_C(0)) & (minor > GS4I_C(0)) & (det > GS4I_C(0));
}

/* S4: F at the stage, in its place, for n particles of the batch. */
static void gs4i_stage_solid(const gs4i_solid_constants *l, gs4i_deformation *e,
                             const gs4i_integrator *integrator, gs4i_gradient L, int n,
                             gs4i_solid_count *count)
{
    gs4i_matrix Y, old;
    gs4i_lanes squared;
    int b, i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            GS4I_BATCH_LOOP(b)
                Y[i][j][b] = integrator->prediction.ahead * e->rate[i][j][b]
                             + integrator->s * (L[i][j][b] - e->rate[i][j][b]);
    if (gs4i_is_small_step(Y, squared)) {
        gs4i_deform(Y, e->F, e->F);
        return;
    }
    memcpy(old, e->F, sizeof old);
    gs4i_deform(Y, e->F, e->F);
    for (b = 0; b < n; b++) {
        double F[3][3];
        if (GS4I_NTH(squared, b) < GS4I_SMALL_STEP || !(GS4I_NTH_CONST(l->modulus, b) > 0))
            continue;
        gs4i_matrix_of(old, b, F);
        if (!gs4i_exponential_step(Y, b, F)) count->failed = b + 1;
        count->split++;
        gs4i_set_matrix(e->F, b, F);
    }
}

/* F of particle n after the step X, scaled to det F = J, then within its limits. From `old` by
 * exp(X); where that is NULL, `now` is what the fraction made of it. */
static void gs4i_correct_one(const gs4i_material_constants *mat, gs4i_matrix X,
                             gs4i_lanes (*old)[3], gs4i_matrix now, double J, int n, gs4i_matrix F,
                             gs4i_solid_count *count)
{
    double one[3][3], scale;
    int i;
    if (!old)
        gs4i_matrix_of(now, n, one);
    else {
        gs4i_matrix_of(old, n, one);
        if (!gs4i_exponential_step(X, n, one)) count->failed = n + 1;
        count->split++;
    }
    scale = cbrt(J / gs4i_determinant(one));
    for (i = 0; i < 9; i++) one[i / 3][i % 3] *= scale;
    if (gs4i_yield_one(one, (double)mat->low, (double)mat->high))
        count->bounded += mat->is.yield_compression <= 0 && mat->is.yield_stretch <= 0;
    gs4i_set_matrix(F, n, one);
}

/* F is `now`, scaled to det F = J; J^(1/3) I where there is no solid. Is each within its limits? It
 * is where F F^T - low^2 and high^2 - F F^T are positive definite. Beyond a trace of 64, chosen,
 * the first has too few digits of det F in float, and double is taken. */
static int gs4i_fit_volume(const gs4i_solid_constants *l, gs4i_matrix now, const gs4i_wide *J,
                           gs4i_matrix F, gs4i_lanes verdict)
{
    int b, c, i, j, all = 1;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide_mask solid = l->modulus[b] > GS4I_C(0);
        const gs4i_wide zero = J[b] - J[b], one = zero + GS4I_C(1);
        gs4i_wide f[3][3], C[3][3], ratio, scale, low[6], high[6];
        gs4i_wide_mask good, below;
        gs4i_matrix_wide(now, b, f);
        gs4i_cofactors(f, C, &ratio);
        ratio = J[b] / ratio;
        GS4I_CHOOSE(ratio, solid, ratio, J[b]);
        gs4i_cube_root(&ratio, &scale);
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) {
                if (i == j)
                    GS4I_CHOOSE(f[i][j], solid, f[i][j], one);
                else
                    GS4I_CHOOSE(f[i][j], solid, f[i][j], zero);
                f[i][j] *= scale;
                F[i][j][b] = f[i][j];
            }
        gs4i_left_cauchy_green(f, low);
        for (c = 0; c < 6; c++) high[c] = -low[c];
        for (c = 0; c < 3; c++) {
            low[c] -= l->low[b] * l->low[b];
            high[c] += l->high[b] * l->high[b];
        }
        gs4i_is_positive(low, &good);
        gs4i_is_positive(high, &below);
        good =
            (good & below & (low[0] + low[1] + low[2] < GS4I_C(64))) | (l->modulus[b] <= GS4I_C(0));
        all &= gs4i_all(&good);
        GS4I_CHOOSE(verdict[b], good, one, zero);
    }
    return all;
}

/* S7 of liquids alone: F = J^(1/3) I, M = L, no spin. */
static void gs4i_let_flow(gs4i_gradient L, const gs4i_wide *J, gs4i_deformation *e)
{
    int b, i;
    memset(e, 0, sizeof *e);
    memcpy(e->rate, L, sizeof e->rate);
    for (i = 0; i < 3; i++)
        GS4I_BATCH_LOOP(b) gs4i_cube_root(&J[b], &e->F[i][i][b]);
}

/* S7: F and M for known grad u = L, det F = J; n particles of the batch. */
static void gs4i_correct_solid(const gs4i_solid_constants *l, gs4i_deformation *e,
                               const gs4i_integrator *integrator, gs4i_gradient L,
                               const gs4i_wide *J, int n, gs4i_solid_count *count)
{
    const gs4_real inv_alpha_m = 1 / integrator->alpha_m;
    gs4i_matrix X, old, now;
    gs4i_lanes squared, verdict;
    int b, i, j, small, fits;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            GS4I_BATCH_LOOP(b) {
                const gs4i_wide change = (L[i][j][b] - e->rate[i][j][b]) * inv_alpha_m;
                const gs4i_wide_mask solid = l->modulus[b] > GS4I_C(0);
                const gs4i_wide next = e->rate[i][j][b] + change;
                X[i][j][b] = integrator->dt * (e->rate[i][j][b] + integrator->gamma * change);
                GS4I_CHOOSE(e->rate[i][j][b], solid, next, L[i][j][b]);
            }
    small = gs4i_is_small_step(X, squared);
    if (!small) memcpy(old, e->F, sizeof old);
    gs4i_deform(X, e->F, now);
    fits = gs4i_fit_volume(l, now, J, e->F, verdict);
    if (small && fits) return;
    for (b = 0; b < n; b++) {
        if (!(GS4I_NTH_CONST(l->modulus, b) > 0)
            || (GS4I_NTH(squared, b) < GS4I_SMALL_STEP && GS4I_NTH(verdict, b) > 0))
            continue;
        gs4i_correct_one(l->of[b], X, GS4I_NTH(squared, b) < GS4I_SMALL_STEP ? NULL : old, now,
                         (double)GS4I_NTH_CONST(J, b), b, e->F, count);
    }
}

/* Bounds the largest eigenvalue, by the largest sum of sizes in a row. */
GS4I_INLINE void gs4i_largest_row(const gs4i_wide s[6], gs4i_wide *most)
{
    gs4i_wide size[6];
    int c, i;
    for (c = 0; c < 6; c++) {
        const gs4i_wide minus = -s[c];
        GS4I_WIDE_MAX(size[c], s[c], minus);
    }
    *most = size[0] - size[0];
    for (i = 0; i < 3; i++) {
        const gs4i_wide row =
            size[gs4i_place[i][0]] + size[gs4i_place[i][1]] + size[gs4i_place[i][2]];
        GS4I_WIDE_MAX(*most, row, *most);
    }
}

/* B - V of F = V R, det F = 1, and the largest row sum of V. R by Newton's rule R <- (R + R^-T)/2
 * from F. Returns whether that has converged for all; in nine steps stretches from 1/32 to 32
 * do. */
static int gs4i_corotated_strain(gs4i_matrix F, gs4i_symmetric strain, gs4i_lanes most)
{
    gs4i_matrix R;
    int b, i, j, step, done = 0;
    memcpy(R, F, sizeof R);
    for (step = 0; step < 9 && !done; step++) {
        done = 1;
        GS4I_BATCH_LOOP(b) {
            gs4i_wide r[3][3], C[3][3], inverse, moved = F[0][0][b] - F[0][0][b];
            gs4i_wide_mask near_by;
            gs4i_matrix_wide(R, b, r);
            gs4i_cofactors(r, C, &inverse);
            inverse = GS4I_C(1) / inverse;
            for (i = 0; i < 3; i++)
                for (j = 0; j < 3; j++) {
                    const gs4i_wide d = GS4I_C(0.5) * (C[i][j] * inverse - r[i][j]);
                    R[i][j][b] += d;
                    moved += d * d;
                }
            /* |dR|^2: the rule converges quadratically, so what is left is half of that */
            near_by = moved < GS4I_C(0.1) * GS4I_EPSILON;
            done &= gs4i_all(&near_by);
        }
    }
    GS4I_BATCH_LOOP(b) {
        gs4i_wide f[3][3], r[3][3], B[6], V[6];
        gs4i_matrix_wide(F, b, f);
        gs4i_matrix_wide(R, b, r);
        gs4i_left_cauchy_green(f, B);
        for (i = 0; i < 3; i++)
            for (j = i; j < 3; j++)
                V[gs4i_place[i][j]] =
                    GS4I_C(0.5)
                    * ((f[i][0] * r[j][0] + f[i][1] * r[j][1] + f[i][2] * r[j][2])
                       + (f[j][0] * r[i][0] + f[j][1] * r[i][1] + f[j][2] * r[i][2]));
        for (i = 0; i < 6; i++) strain[i][b] = B[i] - V[i];
        gs4i_largest_row(V, &most[b]);
    }
    return done;
}

/* Adds the deviatoric stress of F at the volume ratio J to sigma. `stiffness`: density rho0 times
 * the squared speed of elastic waves, at most; 0 for liquids. With b_max of B it is G b_max, or
 * where fixed-corotated G (2 b_max - sqrt(b_max)). In double beyond J from 1/20 to 20, where the
 * cube root is not exact, and beyond b_max = 64, chosen as in gs4i_fit_volume. */
static void gs4i_solid_stress(const gs4i_solid_constants *l, gs4i_matrix F, const gs4i_wide *J,
                              gs4i_symmetric sigma, gs4i_lanes stiffness)
{
    gs4i_matrix iso;
    gs4i_symmetric strain; /* B, or 2 (B - V) */
    gs4i_lanes most, verdict;
    int b, c, i, j, fine = 1;
    memset(most, 0, sizeof most);
    GS4I_BATCH_LOOP(b) {
        gs4i_wide root;
        gs4i_cube_root(&J[b], &root);
        root = GS4I_C(1) / root;
        for (i = 0; i < 3; i++)
            for (j = 0; j < 3; j++) iso[i][j][b] = root * F[i][j][b];
    }
    if (l->any_corotated) fine = gs4i_corotated_strain(iso, strain, most);
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide_mask corotated = l->corotated[b] > GS4I_C(0);
        const gs4i_wide zero = J[b] - J[b], one = zero + GS4I_C(1), scale = l->modulus[b] / J[b];
        gs4i_wide f[3][3], B[6], mean, wave, row;
        gs4i_wide_mask usual;
        gs4i_matrix_wide(iso, b, f);
        gs4i_left_cauchy_green(f, B);
        gs4i_largest_row(B, &wave);
        usual = (J[b] > GS4I_C(0.05)) & (J[b] < GS4I_C(20)) & (wave < GS4I_C(64));
        if (l->any_corotated) {
            row = most[b] * (most[b] + most[b] - GS4I_C(1));
            GS4I_CHOOSE(wave, corotated, row, wave);
            for (c = 0; c < 6; c++) {
                row = strain[c][b] + strain[c][b];
                GS4I_CHOOSE(B[c], corotated, row, B[c]);
            }
        }
        mean = (B[0] + B[1] + B[2]) * GS4I_C(1.0 / 3);
        for (c = 0; c < 3; c++) {
            strain[c][b] = scale * (B[c] - mean);
            strain[c + 3][b] = scale * B[c + 3];
        }
        stiffness[b] = GS4I_SOLID_WAVES * l->modulus[b] * wave;
        GS4I_CHOOSE(verdict[b], usual, one, zero);
        fine &= gs4i_all(&usual);
    }
    /* in double, by singular values */
    for (i = 0; i < GS4I_BATCH && !fine; i++) {
        double one[3][3], s[6] = { 0, 0, 0, 0, 0, 0 }, stiff;
        if (!(GS4I_NTH_CONST(l->modulus, i) > 0)
            || (GS4I_NTH(verdict, i) > 0 && !(GS4I_NTH_CONST(l->corotated, i) > 0)))
            continue;
        gs4i_matrix_of(F, i, one);
        gs4i_solid_stress_one(l->of[i], one, (double)GS4I_NTH_CONST(J, i), s, &stiff);
        for (c = 0; c < 6; c++) GS4I_NTH(strain[c], i) = GS4I_C(s[c]);
        GS4I_NTH(stiffness, i) = GS4I_C(stiff);
    }
    for (c = 0; c < 6; c++)
        GS4I_BATCH_LOOP(b) sigma[c][b] += strain[c][b];
}

/* Gradients of what the grid says to particles beside its velocity: acceleration, and what
 * contact took at once. */
typedef struct gs4i_gathered_rates {
    gs4i_gradient acc, jump;
    gs4i_lanes decay; /* of the sub-grid velocity, 1/s */
} gs4i_gathered_rates;

/* S7: w by (4). The velocity gradient of a particle has the rate grad acc - L L, so w has half its
 * curl. What the grid does not see of w decays at the rate of the sub-grid velocity, implicit in
 * itself. Contact turns at once. */
static void gs4i_correct_spin(const gs4i_solid_constants *l, gs4i_deformation *e,
                              const gs4i_integrator *integrator, gs4i_gradient L,
                              gs4i_gathered_rates *rates)
{
    const gs4_real inv_alpha_m = 1 / integrator->alpha_m;
    int b, i;
    for (i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide w = e->spin[i][b], r = e->spin_rate[i][b], zero = w - w,
                            seen = GS4I_C(0.5) * (L[k][j][b] - L[j][k][b]), decay = rates->decay[b];
            const gs4i_wide LL =
                (L[k][0][b] * L[0][j][b] + L[k][1][b] * L[1][j][b] + L[k][2][b] * L[2][j][b])
                - (L[j][0][b] * L[0][k][b] + L[j][1][b] * L[1][k][b] + L[j][2][b] * L[2][k][b]);
            const gs4i_wide rate = GS4I_C(0.5) * (rates->acc[k][j][b] - rates->acc[j][k][b] - LL),
                            at_once = GS4I_C(0.5) * (rates->jump[k][j][b] - rates->jump[j][k][b]);
            const gs4i_wide stage = (rate + decay * (seen - (w + integrator->before * r)))
                                    * (GS4I_C(1) / (GS4I_C(1) + integrator->s * decay)),
                            change = (stage - r) * inv_alpha_m;
            const gs4i_wide all = ((w + integrator->dt * r)
                                   + integrator->gamma * integrator->dt * change)
                                  + at_once,
                            next_rate = r + change;
            const gs4i_wide next =
                all
                - integrator->decayed_at_once
                      * (w + integrator->before * r + integrator->s * stage - seen);
            const gs4i_wide_mask solid = l->modulus[b] > GS4I_C(0);
            GS4I_CHOOSE(e->spin[i][b], solid, next, zero);
            GS4I_CHOOSE(e->spin_rate[i][b], solid, next_rate, zero);
        }
    }
}

/* F, M, w and dw/dt of n particles from memory, F alone where there are no rates. */
static void gs4i_load_deformation(const gs4_real *from, int reals, int n, gs4i_deformation *e)
{
    gs4i_lanes *l = (gs4i_lanes *)(void *)e; /* 24 in the order of its fields */
    if (reals == 24)
        gs4i_numbers_to_lanes(from, 24, n, l);
    else {
        gs4i_numbers_to_lanes(from, 9, n, l);
        memset(l + 9, 0, 15 * sizeof *l);
    }
}

static void gs4i_store_deformation(gs4_real *to, int reals, int n, gs4i_deformation *e)
{
    gs4i_lanes *l = (gs4i_lanes *)(void *)e;
    if (reals == 24)
        gs4i_lanes_to_numbers(l, 24, n, to);
    else
        gs4i_lanes_to_numbers(l, 9, n, to);
}

/* Forgets all strain but that of the volume: F = J^(1/3) I, M = 0, no spin. */
static void gs4i_undeform(const gs4i_particles *p, size_t i, gs4_real J)
{
    gs4_real *F = p->deformation + (size_t)p->deformation_reals * i;
    memset(F, 0, (size_t)p->deformation_reals * sizeof *F);
    F[0] = F[4] = F[8] = GS4I_C(cbrt((double)J));
}

static void gs4i_set_spin(const gs4i_particles *p, size_t i, gs4_vec3 w)
{
    gs4_real *spin = p->deformation + (size_t)p->deformation_reals * i + 18;
    if (!p->with_rates) return;
    spin[0] = w.x;
    spin[1] = w.y;
    spin[2] = w.z;
    spin[3] = spin[4] = spin[5] = 0;
}

/* ==== [[heat]] temperature, melting and heat flux of particles ================================= *
 *
 * Equation (7) of the manual for a particle. It has an enthalpy per heat capacity (K),
 *
 *     H/c = T + (latent/c) fraction,     latent heat in J/kg, liquid fraction 0 to 1:
 *
 * as heat comes in T rises to T_m, stays there while the fraction goes from 0 to 1, and rises
 * again; back the same way. The phase has hysteresis: liquid once the fraction has reached 1,
 * solid once it is 0 again. Without latent heat both switch at T_m.
 *
 * H/c, with the rate r (K/s), and the non-local flux follow (4); s is the weight of the stage
 * there. What is implicit in T~ has the conductivity k_eff = k (F_T t_q + s) / (t_q + s). The stage
 * of the nodes is
 *
 *     (m c)_i (T~_i - T**_i) / s = sum_p [w_ip V tau:D + grad w_ip . V q** t_q / (t_q + s)]
 *                                + V_i (div k_eff grad T~)_i     ([[conduction]])
 *
 * and a particle takes the rate sum_i w_ip (R - h^2/4 lap R)_i, R = (T~ - T**) / s. Why the
 * Laplacian: to nodes and back again a field f becomes f + (h^2/4) lap f. With R as it is modes
 * decay too slowly, and the stage, T~ = sum w (T + alpha_f dt r) + s (R - r), has an error of
 * first order in dt. The correction moves heat between nodes: what nodes gain particles gain, heat
 * is conserved.
 *
 * What the grid does not see of the temperature of particles decays: r gets
 * -rate (T** - sum_i w_ip (T** - h^2/4 lap T** + 13/240 h^4 lap lap T**)_i), which conserves heat
 * and leaves alone what the grid does see, along an axis to O(h^6). Beside a jump temperatures
 * overshoot by 0.03 % of it; by 0.6 % without the last term. The rate is m = GS4I_MIXING k/(rho c
 * h^2); of the non-local part of conduction m / (1 + m t_q), at most 1/t_q. No rate is above
 * 1/(2 dt): (4) is stable to four times that.
 *
 * Isothermal walls: R is odd about them. At h/4 a particle gathers 0.41 of the rate of its node,
 * at the wall itself none. It would hardly follow, and its neighbours would make up for it: by 4
 * to 9 % of the jump beyond the wall. So there the rate is 1 + GS4I_WALL_MIXING w times as large,
 * w the weight of mirror nodes. That of the non-local part is m / (1 + sqrt(m t_q)) times as much:
 * waves of heat pass a cell in h sqrt(rho c t_q / k). */

/* Chosen: 4 k/(rho c h^2) is how fast the grid's own shortest mode along an axis decays, and what
 * is shorter decays no slower. */
#define GS4I_MIXING GS4I_C(4.0)

/* Chosen: at h/4 from a wall that makes 15 k/(rho c h^2), and heat takes h^2/(16 k/(rho c)) for
 * the way. Measured: 6 and 20 do as well. */
#define GS4I_WALL_MIXING GS4I_C(10.0)

/* W/(m K), in place of 0, so that resistances can be added: materials have 0 or at least 1e-12 */
#define GS4I_LEAST_CONDUCTIVITY GS4I_C(1e-15)

/* J/(kg K); W/(m K); t_q, s; F_T; T_m, K; 1 where viscosity heats, else 0;
 * how far a wave of heat goes in t_q, m */
typedef struct gs4i_heat_constants {
    gs4i_lanes capacity, conductivity, flux_time, fourier, melting, heating, reach;
    const gs4i_material_constants *of[GS4I_BATCH];
    int melts; /* some of those seen so far do */
} gs4i_heat_constants;

/* Of one batch: T (K), liquid fraction, rate of H/c (K/s); the rest of a change that T in its last
 * digit does not hold (K), so that slow changes add up; non-local flux (W/m^2), its rate */
typedef struct gs4i_heat {
    gs4i_lanes T, fraction, rate, remainder, q[4], q_rate[4];
} gs4i_heat;

/* What a batch gives to the nodes: weights times (m c, m c T**, V / k_eff, V). And as forces:
 * grad w . (V q** t_q / (t_q + s)), with a flux only, + w power (W); and w times the mixing,
 * W/K. */
typedef struct gs4i_heat_given {
    gs4_real nodes[4 * GS4I_BATCH];
    gs4i_forces sources;
} gs4i_heat_given;

/* Heat of one batch, in scenes that have it. */
typedef struct gs4i_heat_work {
    const gs4i_integrator *integrator; /* of heat */
    gs4_real ahead;                    /* laws see the temperature of so much later */
    int with_flux;                     /* some material has a non-local flux */
    gs4i_heat_constants constants;
    gs4i_heat h;
    gs4i_heat_given given;
} gs4i_heat_work;

static void gs4i_load_heat_constants(const gs4i_batch_constants *constants, gs4i_heat_constants *l)
{
    int n;
    for (n = 0; n < GS4I_BATCH; n++) {
        const gs4i_material_constants *mat = constants->of[n];
        if (mat == l->of[n]) continue;
        l->of[n] = mat;
        l->melts |= mat->is.can_melt;
        GS4I_NTH(l->capacity, n) = mat->capacity;
        GS4I_NTH(l->conductivity, n) = mat->conductivity;
        GS4I_NTH(l->flux_time, n) = mat->flux_time;
        GS4I_NTH(l->fourier, n) = mat->fourier;
        GS4I_NTH(l->melting, n) = mat->melting;
        GS4I_NTH(l->reach, n) = mat->reach;
        GS4I_NTH(l->heating, n) = mat->is.viscous_heating ? GS4I_C(1) : GS4I_C(0);
    }
}

GS4I_INLINE void gs4i_load_heat(const gs4i_particles *p, size_t i, int n, gs4i_heat *h)
{
    gs4i_lanes own[4];
    gs4i_to_lanes(p->heat + 4 * i, n, own);
    memcpy(h->T, own[0], sizeof h->T);
    memcpy(h->fraction, own[1], sizeof h->fraction);
    memcpy(h->rate, own[2], sizeof h->rate);
    memcpy(h->remainder, own[3], sizeof h->remainder);
    if (!p->with_flux) return;
    gs4i_to_lanes(p->flux + 4 * i, n, h->q);
    gs4i_to_lanes(p->flux_rate + 4 * i, n, h->q_rate);
}

GS4I_INLINE void gs4i_store_heat(const gs4i_particles *p, size_t i, int n, const gs4i_heat *h)
{
    gs4_real own[4 * GS4I_BATCH];
    gs4i_from_lanes(h->T, h->fraction, h->rate, h->remainder, own);
    memcpy(p->heat + 4 * i, own, 4 * (size_t)n * sizeof *own);
    if (!p->with_flux) return;
    gs4i_from_lanes(h->q[0], h->q[1], h->q[2], h->q[3], own);
    memcpy(p->flux + 4 * i, own, 4 * (size_t)n * sizeof *own);
    gs4i_from_lanes(h->q_rate[0], h->q_rate[1], h->q_rate[2], h->q_rate[3], own);
    memcpy(p->flux_rate + 4 * i, own, 4 * (size_t)n * sizeof *own);
}

/* Add `change` (K) to H/c. */
GS4I_INLINE void gs4i_add_enthalpy_one(const gs4i_material_constants *mat, gs4_real change,
                                       gs4_real *T, gs4_real *fraction)
{
    const gs4_real at = mat->melting, heated = *T + change;
    gs4_real above;
    if ((*fraction <= 0 && heated <= at) || (*fraction >= 1 && heated >= at)) {
        *T = heated;
        return;
    }
    above = (*T - at) + *fraction * mat->latent + change;
    *fraction = above <= 0 ? GS4I_C(0) : above >= mat->latent ? GS4I_C(1) : above / mat->latent;
    *T = above <= 0 ? at + above : above >= mat->latent ? at + (above - mat->latent) : at;
}

/* The same for a batch. */
GS4I_INLINE void gs4i_add_enthalpy(const gs4i_heat_constants *l, gs4i_lanes change, gs4i_lanes T,
                                   gs4i_lanes fraction)
{
    int b, plain = 1;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide heated = T[b] + change[b];
        const gs4i_wide_mask stays = ((fraction[b] <= GS4I_C(0)) & (heated <= l->melting[b]))
                                     | ((fraction[b] >= GS4I_C(1)) & (heated >= l->melting[b]));
        plain &= gs4i_all(&stays);
    }
    if (plain) {
        GS4I_BATCH_LOOP(b) T[b] += change[b];
        return;
    }
    for (b = 0; b < GS4I_BATCH; b++) {
        gs4_real own = GS4I_NTH(T, b), part = GS4I_NTH(fraction, b);
        gs4i_add_enthalpy_one(l->of[b], GS4I_NTH(change, b), &own, &part);
        GS4I_NTH(T, b) = own;
        GS4I_NTH(fraction, b) = part;
    }
}

/* The temperature of H + ahead dH/dt. */
static void gs4i_predict_temperature(const gs4i_heat_constants *l, const gs4i_heat *h,
                                     gs4_real ahead, gs4i_lanes T)
{
    gs4i_lanes change, fraction;
    int b;
    GS4I_BATCH_LOOP(b) change[b] = ahead * h->rate[b];
    memcpy(T, h->T, sizeof h->T);
    memcpy(fraction, h->fraction, sizeof fraction);
    gs4i_add_enthalpy(l, change, T, fraction);
}

/* k_eff = k (F_T t_q + s) / (t_q + s), W/(m K). */
GS4I_INLINE void gs4i_effective_conductivity(const gs4i_heat_constants *l,
                                             const gs4i_integrator *integrator, gs4i_lanes k)
{
    int b;
    GS4I_BATCH_LOOP(b)
        k[b] = l->conductivity[b]
               * ((l->fourier[b] * l->flux_time[b] + integrator->s)
                  / (l->flux_time[b] + integrator->s));
}

/* q** + s L q~, L the velocity gradient, q~ predicted: the stage without its conduction. */
static void gs4i_convected_flux(const gs4i_heat *h, const gs4i_integrator *integrator,
                                gs4i_gradient L, gs4i_lanes q[3])
{
    const gs4_real ahead = integrator->prediction.ahead, before = integrator->before,
                   s = integrator->s;
    gs4i_lanes at[3];
    int b, c;
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b) at[c][b] = h->q[c][b] + ahead * h->q_rate[c][b];
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b)
            q[c][b] = (h->q[c][b] + before * h->q_rate[c][b])
                      + s * (L[c][0][b] * at[0][b] + L[c][1][b] * at[1][b] + L[c][2][b] * at[2][b]);
}

/* How strongly a particle mixes, W/K: capacity (J/K) times the rate of the section above. */
GS4I_INLINE void gs4i_mixing_of(const gs4i_heat_work *w, gs4i_lanes volume, gs4i_lanes capacity,
                                gs4i_lanes mixing)
{
    const gs4i_heat_constants *l = &w->constants;
    int b;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide rate =
            GS4I_MIXING * w->integrator->inv_area * l->conductivity[b] * volume[b] / capacity[b];
        mixing[b] =
            capacity[b] * rate
            * (l->fourier[b] + (GS4I_C(1) - l->fourier[b]) / (GS4I_C(1) + rate * l->flux_time[b]));
    }
}

/* S5: what a batch gives to the nodes; mass in kg, volume in m^3, power in W. */
static void gs4i_give_heat(gs4i_heat_work *w, gs4i_gradient L, const gs4i_wide *mass,
                           gs4i_lanes volume, gs4i_lanes power)
{
    const gs4i_heat_constants *l = &w->constants;
    const gs4i_wide least = (mass[0] - mass[0]) + GS4I_LEAST_CONDUCTIVITY;
    gs4i_lanes T, capacity, heat, resistance, mixing, q[3], none;
    gs4i_forces *sources = &w->given.sources;
    int b, c;
    gs4i_predict_temperature(l, &w->h, w->integrator->before, T);
    gs4i_effective_conductivity(l, w->integrator, resistance);
    GS4I_BATCH_LOOP(b) {
        capacity[b] = mass[b] * l->capacity[b];
        heat[b] = capacity[b] * T[b];
        GS4I_WIDE_MAX(resistance[b], resistance[b], least);
        resistance[b] = volume[b] / resistance[b];
    }
    gs4i_mixing_of(w, volume, capacity, mixing);
    gs4i_from_lanes(capacity, heat, resistance, volume, w->given.nodes);
    memset(none, 0, sizeof none);
    gs4i_from_lanes(power, mixing, none, none, sources->weight);
    if (!w->with_flux) return;
    gs4i_convected_flux(&w->h, w->integrator, L, q);
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b)
            q[c][b] *= volume[b] * (l->flux_time[b] / (l->flux_time[b] + w->integrator->s));
    gs4i_from_lanes(q[0], none, none, none, sources->x);
    gs4i_from_lanes(q[1], none, none, none, sources->y);
    gs4i_from_lanes(q[2], none, none, none, sources->z);
}

/* By how much mixing is faster than from[] says, near isothermal walls: there from[3] is the part
 * of the rate from[1] that comes from mirror nodes. With y = sqrt(m t_q) the non-local part of
 * conduction has m / (1 + y^2) in from[1], and m / (1 + y) here. At most 1/(2 dt + 2 before), with
 * (0, 0) 3/8 of 1/dt: from there on (4) has complex roots, and much is to mix here. 3/4 overshot
 * by 14 % of the jump after a first step, 1/2 by 0.2 %. */
static void gs4i_mixing_near_walls(const gs4i_heat_work *w, gs4i_lanes from[4], gs4i_lanes factor)
{
    const gs4i_heat_constants *l = &w->constants;
    const gs4_real per_reach = GS4I_SQRT(GS4I_MIXING * w->integrator->inv_area);
    int b;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide zero = from[3][b] - from[3][b], one = zero + GS4I_C(1),
                        most = zero + GS4I_C(0.5) / (w->integrator->dt + w->integrator->before),
                        tiny = zero + GS4I_TINY,
                        absurd = zero + GS4I_C(1e9) /* its square is a float */,
                        local = l->fourier[b];
        gs4i_wide y = per_reach * l->reach[b], rate, own;
        GS4I_WIDE_MIN(y, y, absurd);
        rate = from[1][b]
               + from[3][b] * GS4I_WALL_MIXING * (local + (one - local) / (one + y))
                     / (local + (one - local) / (one + y * y));
        GS4I_WIDE_MIN(rate, rate, most);
        GS4I_WIDE_MAX(own, from[1][b], tiny);
        rate = rate / own;
        GS4I_CHOOSE(factor[b], from[3][b] > zero, rate, one);
    }
}

/* S7 of H: from[] is R s, the rate of mixing, that times the temperature to mix to, and of the rate
 * what isothermal mirror nodes give. */
static void gs4i_correct_enthalpy(gs4i_heat_work *w, gs4i_lanes from[4])
{
    const gs4i_integrator *integrator = w->integrator;
    gs4i_heat *h = &w->h;
    gs4i_lanes gain, T, fraction, factor;
    int b;
    gs4i_predict_temperature(&w->constants, h, integrator->before, T);
    gs4i_mixing_near_walls(w, from, factor);
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide change =
            ((from[0][b] * (1 / integrator->s) - factor[b] * (from[1][b] * T[b] - from[2][b]))
             - h->rate[b])
            * integrator->inv_alpha_m;
        gain[b] = (integrator->dt * h->rate[b] + integrator->gamma * integrator->dt * change)
                  + h->remainder[b];
        h->rate[b] += change;
    }
    memcpy(T, h->T, sizeof T);
    memcpy(fraction, h->fraction, sizeof fraction);
    gs4i_add_enthalpy(&w->constants, gain, h->T, h->fraction);
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide zero = gain[b] - gain[b], remainder = gain[b] - (h->T[b] - T[b]);
        const gs4i_wide_mask same =
            (h->fraction[b] <= fraction[b]) & (h->fraction[b] >= fraction[b]);
        GS4I_CHOOSE(h->remainder[b], same, remainder, zero);
    }
}

/* S7 of the non-local flux: slope[] is grad T~ (K/m), and 1/k_eff of the nodes (m K/W). Where a
 * worse conductor is near, the flux is that of nodes in series, as between them. More of it than
 * nodes conduct would drive a front that nothing holds. */
static void gs4i_correct_flux(gs4i_heat_work *w, gs4i_lanes slope[4], gs4i_gradient L)
{
    const gs4i_heat_constants *l = &w->constants;
    const gs4i_integrator *integrator = w->integrator;
    gs4i_heat *h = &w->h;
    gs4i_lanes q[3], k /* (1 - F_T) k */;
    int b, c;
    gs4i_convected_flux(h, integrator, L, q);
    gs4i_effective_conductivity(l, integrator, k);
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide one = (h->T[b] - h->T[b]) + GS4I_C(1);
        gs4i_wide in_series = k[b] * slope[3][b];
        GS4I_WIDE_MAX(in_series, in_series, one);
        k[b] = (GS4I_C(1) - l->fourier[b]) * l->conductivity[b] / in_series;
    }
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide before = h->q[c][b] + integrator->before * h->q_rate[c][b];
            const gs4i_wide stage = (l->flux_time[b] * q[c][b] - integrator->s * k[b] * slope[c][b])
                                    / (l->flux_time[b] + integrator->s);
            const gs4i_wide change = ((stage - before) * (1 / integrator->s) - h->q_rate[c][b])
                                     * integrator->inv_alpha_m;
            h->q[c][b] +=
                integrator->dt * h->q_rate[c][b] + integrator->gamma * integrator->dt * change;
            h->q_rate[c][b] += change;
        }
}

/* What was solid forgets its strain as F of a liquid is set; what was liquid, its non-local
 * stress: so that freezing and melting release nothing. */
static void gs4i_set_phase(const gs4i_particles *p, size_t i, int liquid)
{
    if (p->liquid[i] == liquid) return;
    p->liquid[i] = (uint8_t)liquid;
    if (!liquid && p->elastic_reals)
        memset(p->elastic + (size_t)p->elastic_reals * i, 0,
               (size_t)p->elastic_reals * sizeof *p->elastic);
}

/* Fraction and phase that belong to the temperature of particle i; at T_m itself those that are
 * there stay. */
static void gs4i_settle_phase(const gs4i_particles *p, size_t i, const gs4i_material_constants *mat)
{
    gs4_real *heat = p->heat + 4 * i;
    if (!mat->is.can_melt || heat[0] == mat->melting) return;
    heat[1] = GS4I_C(heat[0] > mat->melting ? 1 : 0);
    gs4i_set_phase(p, i, heat[0] > mat->melting);
}

/* Particle i begins at the temperature T. */
static void gs4i_begin_heat(const gs4i_particles *p, size_t i, const gs4i_material_constants *mat,
                            gs4_real T)
{
    gs4_real *heat = p->heat + 4 * i;
    heat[0] = T;
    heat[2] = heat[3] = 0;
    p->liquid[i] = !mat->is.can_melt && mat->is.solid == GS4_NO_SOLID;
    heat[1] = GS4I_C(p->liquid[i]);
    gs4i_settle_phase(p, i, mat);
    if (p->with_flux) {
        memset(p->flux + 4 * i, 0, 4 * sizeof *p->flux);
        memset(p->flux_rate + 4 * i, 0, 4 * sizeof *p->flux_rate);
    }
}

/* ==== [[response]] what a batch of particles answers to a velocity gradient ==================== *
 *
 * All laws together, for a batch of particles in lanes: a velocity gradient L and a volume ratio J
 * in; stress, viscosity and stiffness out. Then the same laws carried to the end of the step.
 * Nothing here knows a grid. What is seen on the way goes to a report.
 *
 *     sigma = -p I + 2 F_v mu D + S + s_F                               (2) with (3), (5), (6)
 *     stiffness: rho times the squared speed of elastic waves, for the limit of the step */

/* Extremes of what the particles of a block were seen to do in a pass; the order of blocks cannot
 * matter. */
typedef struct gs4i_report {
    gs4_real max_speed, max_gradient, min_J, max_J, max_viscosity /* kinematic */, max_sound;
    gs4_real max_stiffness; /* over density: squared speed of elastic waves */
    /* particles that need the robust local integrator; that took it; whose stretch was bounded */
    int hard, split, bounded;
    int left_tile;     /* particles outside of the tile: sort and try again */
    int left;          /* particles that went out through an open wall */
    uint64_t substeps; /* of non-local stress */
    uint64_t rows;     /* of the tile that its particles touch */
    int bad;           /* GS4I_BAD_*: a particle cannot be trusted */
    uint32_t bad_id;
} gs4i_report;

enum {
    GS4I_BAD_VOLUME = 1,
    GS4I_BAD_MOTION,
    GS4I_BAD_VISCOSITY,
    GS4I_BAD_STRESS,
    GS4I_BAD_DEFORMATION
};

/* A volume ratio outside of this range is refused: Tait's equation is far beyond its own there. A
 * soft liquid that a dense one has pressed flies apart, until its particles, half a cell apart at
 * first, are three cells apart and see each other no more: 6^3. */
#define GS4I_J_LOW GS4I_C(0.0625)
#define GS4I_J_HIGH GS4I_C(256)

static void gs4i_report_clear(gs4i_report *r)
{
    memset(r, 0, sizeof *r);
    r->min_J = GS4I_HUGE;
}

/* The extremes of `r` into those of `into`. */
static void gs4i_report_merge(gs4i_report *into, const gs4i_report *r)
{
    into->max_speed = gs4i_max(into->max_speed, r->max_speed);
    into->max_gradient = gs4i_max(into->max_gradient, r->max_gradient);
    into->min_J = gs4i_min(into->min_J, r->min_J);
    into->max_J = gs4i_max(into->max_J, r->max_J);
    into->max_viscosity = gs4i_max(into->max_viscosity, r->max_viscosity);
    into->max_sound = gs4i_max(into->max_sound, r->max_sound);
    into->max_stiffness = gs4i_max(into->max_stiffness, r->max_stiffness);
    into->split += r->split;
    into->bounded += r->bounded;
    into->substeps += r->substeps;
    into->left_tile += r->left_tile;
    into->left += r->left;
    if (r->bad && !into->bad) {
        into->bad = r->bad;
        into->bad_id = r->bad_id;
    }
}

/* Extremes of a pass, still in lanes. */
typedef struct gs4i_seen {
    gs4i_lanes min_J, max_J, max_viscosity, max_sound, max_stiffness, speed2, gradient2;
} gs4i_seen;

GS4I_INLINE void gs4i_see_nothing(gs4i_seen *r)
{
    int b;
    memset(r, 0, sizeof *r);
    GS4I_BATCH_LOOP(b) r->min_J[b] += GS4I_HUGE;
}

GS4I_INLINE void gs4i_see_liquids(gs4i_seen *r, const gs4i_batch_constants *l, const gs4i_wide *J,
                                  const gs4i_wide *mu)
{
    int b;
    GS4I_BATCH_LOOP(b) {
        /* by (3) */
        const gs4i_wide viscosity = mu[b] * l->inv_density[b],
                        sound = l->wave_speed[b] / (J[b] * J[b] * J[b]);
        GS4I_WIDE_MIN(r->min_J[b], r->min_J[b], J[b]);
        GS4I_WIDE_MAX(r->max_J[b], r->max_J[b], J[b]);
        GS4I_WIDE_MAX(r->max_viscosity[b], r->max_viscosity[b], viscosity);
        GS4I_WIDE_MAX(r->max_sound[b], r->max_sound[b], sound);
    }
}

/* Largest speed along an axis and largest |L|, squared */
GS4I_INLINE void gs4i_see_motion(gs4i_seen *r, gs4i_lanes v[3], gs4i_gradient L)
{
    gs4i_lanes squared;
    int b, i;
    gs4i_gradient_squared(L, squared);
    GS4I_BATCH_LOOP(b) {
        for (i = 0; i < 3; i++) {
            const gs4i_wide v2 = v[i][b] * v[i][b];
            GS4I_WIDE_MAX(r->speed2[b], r->speed2[b], v2);
        }
        GS4I_WIDE_MAX(r->gradient2[b], r->gradient2[b], squared[b]);
    }
}

static gs4_real gs4i_largest(const gs4i_wide *lanes)
{
    gs4_real most = 0;
    int n;
    for (n = 0; n < GS4I_BATCH; n++) most = gs4i_max(most, GS4I_NTH_CONST(lanes, n));
    return most;
}

static void gs4i_report_liquids(gs4i_report *r, const gs4i_seen *s)
{
    int n;
    for (n = 0; n < GS4I_BATCH; n++) r->min_J = gs4i_min(r->min_J, GS4I_NTH_CONST(s->min_J, n));
    r->max_J = gs4i_largest(s->max_J);
    r->max_viscosity = gs4i_largest(s->max_viscosity);
    r->max_sound = gs4i_largest(s->max_sound);
    r->max_stiffness = gs4i_largest(s->max_stiffness);
}

static void gs4i_report_motion(gs4i_report *r, const gs4i_seen *s)
{
    r->max_speed = gs4i_largest(s->speed2);
    r->max_gradient = gs4i_largest(s->gradient2);
}

GS4I_INLINE void gs4i_see_bad(gs4i_report *r, int reason, uint32_t id)
{
    if (!r->bad) {
        r->bad = reason;
        r->bad_id = id;
    }
}

/* Volume ratios and viscosities that cannot be trusted: seen at once in lanes, looked for one by
 * one only when there are some. */
GS4I_INLINE void gs4i_check_liquids(gs4i_report *r, const gs4i_wide *J, gs4i_lanes mu,
                                    const uint32_t *id, int n)
{
    int b, good = 1;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide_mask fine =
            (J[b] > GS4I_J_LOW) & (J[b] < GS4I_J_HIGH) & (mu[b] >= GS4I_C(0)) & (mu[b] < GS4I_HUGE);
        good &= gs4i_all(&fine);
    }
    for (b = 0; b < n && !good; b++) {
        const gs4_real own_J = GS4I_NTH_CONST(J, b), own_mu = GS4I_NTH(mu, b);
        if (!(own_J > GS4I_J_LOW && own_J < GS4I_J_HIGH)) gs4i_see_bad(r, GS4I_BAD_VOLUME, id[b]);
        if (!(own_mu >= 0 && own_mu < GS4I_HUGE)) gs4i_see_bad(r, GS4I_BAD_VISCOSITY, id[b]);
    }
}

/* What laws need to know of a batch, and where they say what they saw. */
typedef struct gs4i_response {
    const gs4i_particles *p;
    const gs4i_integrator *integrator; /* NULL: stress of now, not of a stage */
    const gs4i_material_constants *materials, *solid_phase;
    gs4i_report *report;
    gs4i_heat_work *heat; /* NULL: the scene has none */
    size_t i;
    int n; /* the batch: particles i to i + n */
    gs4i_batch_constants constants;
    gs4i_elastic_constants elastic;
    gs4i_solid_constants solid;
    gs4i_seen seen;
} gs4i_response;

/* Turn to particles i to i + n: constants, and the temperature at the stage (Euler: now), which
 * laws see. */
GS4I_INLINE void gs4i_turn_to_batch(gs4i_response *r, size_t i, int n)
{
    r->i = i;
    r->n = n;
    gs4i_load_constants(r->materials, r->solid_phase, r->p, i, n, &r->constants);
}

static void gs4i_load_batch_heat(gs4i_response *r)
{
    gs4i_heat_work *w = r->heat;
    gs4i_load_heat(r->p, r->i, r->n, &w->h);
    gs4i_load_heat_constants(&r->constants, &w->constants);
    if (r->constants.varies & GS4I_BY_CALL)
        gs4i_predict_temperature(&w->constants, &w->h, w->ahead, r->constants.temperature);
}

GS4I_INLINE gs4_real *gs4i_elastic_of(const gs4i_response *r)
{
    return r->p->elastic + (size_t)r->p->elastic_reals * r->i;
}

GS4I_INLINE gs4_real *gs4i_deformation_of(const gs4i_response *r)
{
    return r->p->deformation + (size_t)r->p->deformation_reals * r->i;
}

/* Squared speed of elastic waves, and particles where it is no number. */
static void gs4i_see_stiffness(gs4i_response *r, gs4i_lanes stiffness)
{
    int b, good = 1;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide_mask fine = stiffness[b] < GS4I_HUGE;
        const gs4i_wide speed2 = stiffness[b] * r->constants.wave_volume[b];
        GS4I_WIDE_MAX(r->seen.max_stiffness[b], r->seen.max_stiffness[b], speed2);
        good &= gs4i_all(&fine);
    }
    for (b = 0; b < r->n && !good; b++)
        if (!(GS4I_NTH(stiffness, b) < GS4I_HUGE))
            gs4i_see_bad(r->report, GS4I_BAD_STRESS, r->p->id[r->i + (size_t)b]);
}

static void gs4i_see_elastic_count(gs4i_response *r, const gs4i_elastic_count *count)
{
    const uint32_t *id = r->p->id + r->i;
    if (count->no_modulus) gs4i_see_bad(r->report, GS4I_BAD_VISCOSITY, id[count->no_modulus - 1]);
    if (count->failed) gs4i_see_bad(r->report, GS4I_BAD_STRESS, id[count->failed - 1]);
    r->report->substeps += (uint64_t)count->substeps;
}

/* Add the non-local stress of the stage (GS4) or of now to sigma. */
static void gs4i_add_elastic(gs4i_response *r, gs4i_gradient L, gs4i_symmetric sigma)
{
    gs4i_elastic e;
    gs4i_elastic_count count = { 0, 0, 0, 0, 0 };
    gs4i_symmetric s;
    gs4i_lanes G, stiffness;
    int b, c;
    if (r->report->bad) return; /* refused anyway: a particle that fails takes some 50 ms */
    gs4i_load_elastic_constants(&r->constants, &r->elastic);
    gs4i_moduli(&r->elastic, L, r->n, G, &count);
    gs4i_load_elastic(gs4i_elastic_of(r), r->p->elastic_reals, r->n, &e);
    if (r->p->with_rates && r->integrator)
        gs4i_stage_elastic(&r->elastic, G, &e, r->integrator, L, r->n, s, &count);
    else
        memcpy(s, e.s, sizeof s);
    for (c = 0; c < 6; c++)
        GS4I_BATCH_LOOP(b) sigma[c][b] += s[c][b];
    gs4i_see_elastic(G, s, stiffness);
    gs4i_see_elastic_count(r, &count);
    gs4i_see_stiffness(r, stiffness);
    /* S7 asks for viscosities at other rates: no node can prove them */
    r->report->hard += count.split + r->elastic.varies;
}

/* Add the stress of solids at the stage, where the volume ratio is J, or now. */
static void gs4i_add_solid(gs4i_response *r, gs4i_gradient L, const gs4i_wide *J,
                           gs4i_symmetric sigma)
{
    gs4i_deformation e;
    gs4i_solid_count count = { 0, 0, 0 };
    gs4i_lanes stiffness;
    if (!gs4i_load_solid_constants(&r->constants, &r->solid)) return;
    gs4i_load_deformation(gs4i_deformation_of(r), r->p->deformation_reals, r->n, &e);
    if (r->p->with_rates && r->integrator)
        gs4i_stage_solid(&r->solid, &e, r->integrator, L, r->n, &count);
    gs4i_solid_stress(&r->solid, e.F, J, sigma, stiffness);
    gs4i_see_stiffness(r, stiffness);
    if (count.failed)
        gs4i_see_bad(r->report, GS4I_BAD_DEFORMATION, r->p->id[r->i + (size_t)count.failed - 1]);
}

/* Stress (Pa) and viscosity mu (Pa s) of all laws for L and J; extremes are seen. */
GS4I_INLINE void gs4i_stress(gs4i_response *r, gs4i_gradient L, const gs4i_wide *J,
                             gs4i_symmetric sigma, gs4i_wide *mu)
{
    gs4i_liquid_stress(&r->constants, J, L, sigma, mu);
    gs4i_see_liquids(&r->seen, &r->constants, J, mu);
    if (r->p->elastic_reals) gs4i_add_elastic(r, L, sigma);
    if (r->p->deformation_reals) gs4i_add_solid(r, L, J, sigma);
}

/* tau:D (W) of particles that viscosity heats: the stress without the pressure, whose work
 * compression gives back; and what the batch gives to the nodes. */
static void gs4i_heat_of_stress(gs4i_response *r, const gs4i_wide *mass, const gs4i_wide *J,
                                gs4i_gradient L, gs4i_symmetric sigma)
{
    gs4i_heat_work *w = r->heat;
    gs4i_lanes volume, power;
    int b;
    GS4I_BATCH_LOOP(b) {
        gs4i_wide p;
        volume[b] = mass[b] * r->constants.inv_density[b] * J[b];
        gs4i_pressure(&r->constants.tait[b], &J[b], &p);
        power[b] =
            w->constants.heating[b] * volume[b]
            * ((sigma[0][b] + p) * L[0][0][b] + (sigma[1][b] + p) * L[1][1][b]
               + (sigma[2][b] + p) * L[2][2][b] + sigma[3][b] * (L[0][1][b] + L[1][0][b])
               + sigma[4][b] * (L[0][2][b] + L[2][0][b]) + sigma[5][b] * (L[1][2][b] + L[2][1][b]));
    }
    gs4i_give_heat(w, L, mass, volume, power);
}

/* The integrator of quantities that have no rates: backward Euler. */
static gs4i_integrator gs4i_without_rates(const gs4i_integrator *integrator)
{
    gs4i_integrator euler = *integrator;
    euler.alpha_m = euler.alpha_f = euler.gamma = 1;
    euler.restart = 0;
    return euler;
}

/* S7 of the non-local stress; with `commit` 0 only whether it can be done. */
static void gs4i_advance_elastic(gs4i_response *r, gs4i_gradient L, int commit)
{
    const gs4i_integrator euler = gs4i_without_rates(r->integrator);
    gs4i_elastic e;
    gs4i_elastic_count count = { 0, 0, 0, 0, 0 };
    if (r->report->bad && !commit) return;
    gs4i_load_elastic_constants(&r->constants, &r->elastic);
    gs4i_load_elastic(gs4i_elastic_of(r), r->p->elastic_reals, r->n, &e);
    gs4i_correct_elastic(&r->elastic, &e, r->p->with_rates ? r->integrator : &euler, L, r->n,
                         &count);
    gs4i_see_elastic_count(r, &count);
    if (!commit) return;
    r->report->split += count.split;
    r->report->bounded += count.bounded;
    gs4i_store_elastic(gs4i_elastic_of(r), r->p->elastic_reals, r->n, &e);
}

/* S7 of F, to the volume ratio J, and of the spin, but for Euler; with `commit` 0 only whether it
 * can be done. */
static void gs4i_advance_solid(gs4i_response *r, gs4i_gradient L, gs4i_gathered_rates *rates,
                               const gs4i_wide *J, int commit)
{
    const gs4i_integrator euler = gs4i_without_rates(r->integrator);
    gs4i_deformation e;
    gs4i_solid_count count = { 0, 0, 0 };
    if (!gs4i_load_solid_constants(&r->constants, &r->solid))
        gs4i_let_flow(L, J, &e);
    else {
        gs4i_load_deformation(gs4i_deformation_of(r), r->p->deformation_reals, r->n, &e);
        gs4i_correct_solid(&r->solid, &e, r->p->with_rates ? r->integrator : &euler, L, J, r->n,
                           &count);
        if (rates) gs4i_correct_spin(&r->solid, &e, r->integrator, L, rates);
    }
    if (count.failed)
        gs4i_see_bad(r->report, GS4I_BAD_DEFORMATION, r->p->id[r->i + (size_t)count.failed - 1]);
    if (!commit) return;
    r->report->split += count.split;
    r->report->bounded += count.bounded;
    gs4i_store_deformation(gs4i_deformation_of(r), r->p->deformation_reals, r->n, &e);
}

/* S7 of stress and deformation, of batch i to i + n, to the volume ratio J. */
static void gs4i_advance_response(gs4i_response *r, size_t i, int n, gs4i_gradient L,
                                  gs4i_gathered_rates *rates, const gs4i_wide *J, int commit)
{
    if (!r->p->elastic_reals && !r->p->deformation_reals && !r->heat) return;
    gs4i_turn_to_batch(r, i, n);
    if (r->heat && r->constants.varies & GS4I_BY_CALL) gs4i_load_batch_heat(r);
    if (r->p->elastic_reals) gs4i_advance_elastic(r, L, commit);
    if (r->p->deformation_reals) gs4i_advance_solid(r, L, rates, J, commit);
}

/* ==== [[boundary]] walls by images, bodies by nodes, what contact does to velocities =========== *
 *
 * Walls lie on cell faces, so the node pairs  ... -2 -1 | 0 1 ...  mirror each other:  image
 * -1-k <-> k. Mass and momentum that reach an image are folded back onto its mirror node, forces
 * too, with the sign S of the reflection (stick: -1 in all components; slip: -1 in the normal
 * one; periodic: the node a period away, S = 1); afterwards images hold S times the field of
 * their mirror node. Slippery bodies hold the nodes inside of them; sticky ones act by images of
 * particles, see gs4i_place_image_particle.
 *
 * What contact takes from the velocity of a node at once is no acceleration: it is kept as a
 * jump, which goes to the velocity of the particles directly and never into their rates (METHOD:
 * "contact stays out of the rates"). */

/* Numbers of a mirror node and of the node inside whose field it continues. */
typedef struct gs4i_mirror_pair {
    uint32_t mirror, inner;
} gs4i_mirror_pair;

/* Sampled distance of a mesh, trilinear between samples: c, 0 <= c < n, is at low + c spacing. They
 * are exact within `band` of the surface, +-band beyond, and kept in blocks of 8^3. A block all
 * beyond has none. Only the blocks of a window are there, which the domain cannot leave. */
typedef struct gs4i_field {
    int n[3];
    int first[3], blocks[3]; /* the window */
    double low[3], spacing, band;
    int32_t *block; /* of the window, x fastest: where its samples are, or GS4I_FIELD_* */
    gs4_real *distance;
    int count; /* of blocks that have samples */
} gs4i_field;

#define GS4I_FIELD_BLOCK 512
enum {
    GS4I_FIELD_OUTSIDE = -1,
    GS4I_FIELD_INSIDE = -2
};

/* A shape with a pose, of a collider or an emitter. World point p is shape point
 * R^T (p - at) + pivot. */
typedef struct gs4i_collider {
    gs4_collider is; /* as described */
    /* where the pivot is now; orientation, unit quaternion w x y z */
    double at[3], turn[4];
    gs4_real axes[9]; /* R, row-major */
    gs4i_field field; /* for a mesh */
    /* of an emitter: what is inside flows with the velocity `flow` in coordinates of the shape,
     * beside its own; not in use now */
    int is_emitter, is_off;
    gs4_vec3 flow;
    int *bad_distance; /* of the simulation: set where the shape's function gives no number */
} gs4i_collider;

/* A particle of a block near sticky bodies. */
typedef struct gs4i_near_particle {
    /* how far it is from the nearest body, how far that bends away from a half space, the sum of
     * its curvatures there, see gs4i_sample_patch, and its normal */
    gs4_real d, bend, curvature, n[3];
    int32_t body; /* the nearest, -1: none is within three cells */
    /* the first node that it sees in the tile of its block; slot of its image, later the image's
     * number, or GS4I_NO_IMAGE, GS4I_HOLDS_NODES */
    int32_t base, image;
} gs4i_near_particle;

/* The image of a particle behind the surface of a sticky collider: gs4i_place_image_particle. */
typedef struct gs4i_image_particle {
    gs4_real x[4]; /* place and mass */
    /* of the odd part of what the particle sees: 1 within half a cell of the surface, 0 from one
     * and a half */
    gs4_real share;
    gs4_real part;   /* of the particle's mass and volume, see gs4i_image_part */
    int whole, slot; /* all its nodes exist; block of x */
    /* normal of the surface; the body's velocity at its foot and angular velocity */
    gs4_real n[3], v[3], spin[3];
    /* to the nodes: momentum at x (Euler: and columns of its affine part); columns of force, and
     * weight */
    gs4_real carried[4][4];
    /* from them: velocity and acceleration, value and columns of the gradient */
    gs4_real seen[2][4][4];
} gs4i_image_particle;

/* The nodes of a slot near a sticky body where it is not flat, with four numbers each, of which
 * three are in use: see gs4i_sample_patch. */
typedef struct gs4i_patch {
    int collider, slot;
    gs4_real nearest, bend[2]; /* least distance, least and greatest bend of its nodes */
    uint64_t clear;            /* of each node a bit: see gs4i_is_clear */
} gs4i_patch;

/* What the particles of a block have of the surface of a body. */
typedef struct gs4i_surface {
    int kind, has_images; /* GS4I_SURFACE_*; may particles have images by it? */
    gs4_vec3 at, n;       /* midst of the block; where the body is flat, its normal */
    gs4_real d;           /* distance of `at` */
    gs4_real nearest;     /* no node that particles of the block see is nearer, up to three cells */
} gs4i_surface;

typedef struct gs4i_patches {
    int count, still; /* so many, those of bodies at rest first */
    /* int32_t: 1 + number of the patch, or 0, per collider and slot; gs4i_patch; distances of
     * nodes; their four numbers; gs4i_surface, per collider and occupied block */
    gs4i_scratch of, all, distance, nodes, surfaces;
    /* for which those at rest hold: gs4i_collider, block of each slot */
    gs4i_scratch colliders, blocks;
    int collider_count, active, occupied;
} gs4i_patches;

typedef struct gs4i_image_particles {
    /* particles of the blocks near sticky bodies, 0: there are none; images */
    int near, count;
    /* gs4i_near_particle; per occupied block: its first one, or -1 (int32_t); gs4i_image_particle;
     * per occupied block its first one, and one more at the end (int32_t) */
    gs4i_scratch of_particles, of, all, first_of;
    /* int32_t: sorted by slot; per slot, where it begins; slots that have some, by colour */
    gs4i_scratch order, first, slots;
    int colour_first[9];
    gs4i_patches patches;
} gs4i_image_particles;

typedef struct gs4i_boundary {
    gs4_wall walls[6];
    /* per wall, while the blocks stay */
    gs4i_mirror_pair *mirrors[6];
    int mirror_count[6], mirror_capacity[6];
    gs4i_collider *colliders;
    int collider_count, collider_capacity;
    gs4_real h;
} gs4i_boundary;

static void gs4i_collider_orient(gs4i_collider *b)
{
    double w = b->turn[0], x = b->turn[1], y = b->turn[2], z = b->turn[3];
    const double r[9] = {
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
        2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)
    };
    int i;
    for (i = 0; i < 9; i++) b->axes[i] = GS4I_C(r[i]);
}

/* sin(x)/x and cos x from x^2 by their series: the same bits with every libm. To rounding where
 * |x| < 1/2; x is half the angle of a step, which the stable step keeps within 1/sqrt(8). */
static void gs4i_sinc_cos(double x2, double *sinc, double *cosine)
{
    double s = 1, c = 1;
    int k;
    for (k = 16; k >= 2; k -= 2) { /* the rest is less than 2^-18/18! */
        s = 1 - x2 / (k * (k + 1)) * s;
        c = 1 - x2 / (k * (k - 1)) * c;
    }
    *sinc = s;
    *cosine = c;
}

/* Pose after dt: the pivot moves, the body turns about it by the angle |omega| dt. */
static void gs4i_collider_move(gs4i_collider *b, double dt)
{
    double o[3], square, q[4], s, c, x, y, z, norm = 0;
    const double *t = b->turn;
    int i;
    gs4i_to_double(b->is.angular_velocity, o);
    square = o[0] * o[0] + o[1] * o[1] + o[2] * o[2];
    gs4i_sinc_cos(0.25 * dt * dt * square, &s, &c);
    x = o[0] * s * 0.5 * dt;
    y = o[1] * s * 0.5 * dt;
    z = o[2] * s * 0.5 * dt;
    b->at[0] += (double)b->is.velocity.x * dt;
    b->at[1] += (double)b->is.velocity.y * dt;
    b->at[2] += (double)b->is.velocity.z * dt;
    if (!(square > 0)) return;
    q[0] = c * t[0] - x * t[1] - y * t[2] - z * t[3];
    q[1] = c * t[1] + x * t[0] + y * t[3] - z * t[2];
    q[2] = c * t[2] - x * t[3] + y * t[0] + z * t[1];
    q[3] = c * t[3] + x * t[2] - y * t[1] + z * t[0];
    for (i = 0; i < 4; i++) norm += q[i] * q[i];
    /* 1/sqrt(norm) to the square of what norm is off 1 */
    for (i = 0; i < 4; i++) b->turn[i] = q[i] * (1.5 - 0.5 * norm);
    gs4i_collider_orient(b);
}

static int gs4i_is_moving(const gs4i_collider *b)
{
    return gs4i_length(b->is.velocity) > 0 || gs4i_length(b->is.angular_velocity) > 0;
}

/* A direction of the shape in the world. */
static gs4_vec3 gs4i_turned(const gs4i_collider *b, gs4_vec3 d)
{
    const gs4_real *r = b->axes;
    return gs4i_vec3(r[0] * d.x + r[1] * d.y + r[2] * d.z, r[3] * d.x + r[4] * d.y + r[5] * d.z,
                     r[6] * d.x + r[7] * d.y + r[8] * d.z);
}

/* World velocity of the body at p; in an emitter, of what flows in it. */
static gs4_vec3 gs4i_collider_velocity(const gs4i_collider *b, gs4_vec3 p)
{
    gs4_vec3 r = gs4i_sub(p, gs4i_vec3(GS4I_C(b->at[0]), GS4I_C(b->at[1]), GS4I_C(b->at[2])));
    gs4_vec3 own = gs4i_add(b->is.velocity, gs4i_cross(b->is.angular_velocity, r));
    return b->is_emitter ? gs4i_add(own, gs4i_turned(b, b->flow)) : own;
}

/* Greatest |v + w x (p - pivot)| for p in the box low .. high: at one of its corners. */
static double gs4i_fastest_corner(gs4_vec3 low, gs4_vec3 high, const double pivot[3], gs4_vec3 v,
                                  gs4_vec3 w)
{
    double from[2][3], own[3], turn[3], most = 0;
    int i, a;
    gs4i_to_double(low, from[0]);
    gs4i_to_double(high, from[1]);
    gs4i_to_double(v, own);
    gs4i_to_double(w, turn);
    for (i = 0; i < 8; i++) {
        double r[3], square = 0;
        for (a = 0; a < 3; a++) r[a] = from[i >> a & 1][a] - pivot[a];
        for (a = 0; a < 3; a++) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            const double u = own[a] + turn[b] * r[c] - turn[c] * r[b];
            square += u * u;
        }
        most = fmax(most, square);
    }
    return sqrt(most);
}

/* R^T v: a world vector in the directions of the shape. */
GS4I_INLINE gs4_vec3 gs4i_turn_back(const gs4i_collider *b, gs4_vec3 v)
{
    const gs4_real *r = b->axes;
    return gs4i_vec3(r[0] * v.x + r[3] * v.y + r[6] * v.z, r[1] * v.x + r[4] * v.y + r[7] * v.z,
                     r[2] * v.x + r[5] * v.y + r[8] * v.z);
}

/* Greatest speed (m/s) of a body where the domain can meet it: no part of it is out of the box
 * around its shape, and none that counts out of the domain. A ball that turns about its own
 * centre has the speed of its surface, which drags. Cylinders by their ends: exact about their
 * axis, at most r |w| too much. */
static gs4_real gs4i_collider_speed(const gs4i_collider *b, const gs4i_grid *g)
{
    const gs4_shape *s = &b->is.shape;
    const gs4_vec3 size = gs4i_vec3(GS4I_C(g->cells[0]), GS4I_C(g->cells[1]), GS4I_C(g->cells[2])),
                   v = gs4i_turn_back(b, b->is.velocity),
                   w = gs4i_turn_back(b, b->is.angular_velocity);
    const gs4_real turn = gs4i_length(w);
    gs4_vec3 low = s->a, high = s->kind == GS4_SHAPE_SPHERE ? s->a : s->b;
    double pivot[3], most, own;
    if (!(turn > 0)) return gs4i_length(b->is.velocity);
    most = gs4i_fastest_corner(g->origin, gs4i_add(g->origin, gs4i_scale(size, g->h)), b->at,
                               b->is.velocity, b->is.angular_velocity);
    most = fmin(most, (double)GS4I_HUGE);
    gs4i_to_double(b->is.pivot, pivot);
    if (s->kind == GS4_SHAPE_SPHERE || s->kind == GS4_SHAPE_CYLINDER) /* its ends, or centre */
        own = fmax(gs4i_fastest_corner(low, low, pivot, v, w),
                   gs4i_fastest_corner(high, high, pivot, v, w))
              + (double)(turn * s->radius);
    else if (s->kind == GS4_SHAPE_PLANE)
        own = most;
    else {
        gs4i_shape_bounds(s, &low, &high);
        own = gs4i_fastest_corner(low, high, pivot, v, w);
    }
    return GS4I_C(fmin(most, own));
}

/* Where in `block` the entry of sample i, j, k is. */
GS4I_INLINE size_t gs4i_field_block_of(const gs4i_field *f, int i, int j, int k)
{
    return ((size_t)((k >> 3) - f->first[2]) * (size_t)f->blocks[1]
            + (size_t)((j >> 3) - f->first[1]))
               * (size_t)f->blocks[0]
           + (size_t)((i >> 3) - f->first[0]);
}

/* The sample itself, of block number `block`. */
GS4I_INLINE gs4_real *gs4i_field_sample(const gs4i_field *f, int32_t block, int i, int j, int k)
{
    return f->distance + (size_t)block * GS4I_FIELD_BLOCK + (k & 7) * 64 + (j & 7) * 8 + (i & 7);
}

/* The eight samples from c on, x fastest: quicker where one block has them all. */
GS4I_INLINE void gs4i_field_cell(const gs4i_field *f, const int c[3], gs4_real value[8])
{
    const int is_one = (c[0] & 7) < 7 && (c[1] & 7) < 7 && (c[2] & 7) < 7;
    int32_t block = f->block[gs4i_field_block_of(f, c[0], c[1], c[2])];
    int i;
    if (is_one && block >= 0) {
        const gs4_real *d = gs4i_field_sample(f, block, c[0], c[1], c[2]);
        for (i = 0; i < 8; i++) value[i] = d[(i & 1) + 8 * (i >> 1 & 1) + 64 * (i >> 2)];
        return;
    }
    for (i = 0; i < 8; i++) {
        const int x = c[0] + (i & 1), y = c[1] + (i >> 1 & 1), z = c[2] + (i >> 2);
        if (!is_one) block = f->block[gs4i_field_block_of(f, x, y, z)];
        value[i] = block >= 0 ? *gs4i_field_sample(f, block, x, y, z)
                              : GS4I_C(block == GS4I_FIELD_INSIDE ? -f->band : f->band);
    }
}

/* Trilinear; outside of the samples the distance to them is added. */
static gs4_real gs4i_field_distance(const gs4i_field *f, gs4_vec3 p)
{
    double x[3], out = 0, value = 0;
    gs4_real corner[8];
    int c[3], a, i;
    gs4i_to_double(p, x);
    for (a = 0; a < 3; a++) {
        const double t = (x[a] - f->low[a]) / f->spacing,
                     inside = t > 0 ? (t < f->n[a] - 1 ? t : f->n[a] - 1) : 0; /* 0: t is NaN */
        const int end = 8 * (f->first[a] + f->blocks[a]);
        out += (t - inside) * (t - inside);
        c[a] = (int)inside;
        if (c[a] > f->n[a] - 2) c[a] = f->n[a] - 2;
        /* beyond the window nobody asks but for NaN */
        if (c[a] > end - 2) c[a] = end - 2;
        if (c[a] < 8 * f->first[a]) c[a] = 8 * f->first[a];
        x[a] = inside - c[a];
    }
    gs4i_field_cell(f, c, corner);
    for (i = 0; i < 8; i++)
        value += (double)corner[i] * (i & 1 ? x[0] : 1 - x[0]) * (i & 2 ? x[1] : 1 - x[1])
                 * (i & 4 ? x[2] : 1 - x[2]);
    return GS4I_C(value + sqrt(out) * f->spacing);
}

/* To 1, whatever threads do so at once. */
static void gs4i_raise(int *flag)
{
#if defined(__GNUC__) && !defined(__TINYC__)
    __atomic_store_n(flag, 1, __ATOMIC_RELAXED);
#else
    *(volatile int *)flag = 1;
#endif
}

/* The same in the coordinates of the shape. Where a function gives no number the point counts as
 * outside, and whoever asked learns of it by gs4i_check_distances. */
static gs4_real gs4i_shape_or_field(const gs4i_collider *b, gs4_vec3 p)
{
    const gs4_real d = b->field.distance ? gs4i_field_distance(&b->field, p)
                                         : gs4i_shape_distance(&b->is.shape, p);
    if (d >= -GS4I_HUGE && d <= GS4I_HUGE) return d;
    if (!gs4i_finite(d) && b->bad_distance) gs4i_raise(b->bad_distance);
    return d < 0 && gs4i_finite(d) ? -GS4I_HUGE : GS4I_HUGE;
}

/* World point p in the coordinates of the shape. */
static gs4_vec3 gs4i_to_collider(const gs4i_collider *b, gs4_vec3 p)
{
    const gs4_vec3 at = gs4i_vec3(GS4I_C(b->at[0]), GS4I_C(b->at[1]), GS4I_C(b->at[2]));
    return gs4i_add(gs4i_turn_back(b, gs4i_sub(p, at)), b->is.pivot);
}

/* Point p of the shape in the world. */
static void gs4i_from_collider(const gs4i_collider *b, const double p[3], gs4_real x[3])
{
    double d[3], pivot[3];
    int a;
    gs4i_to_double(b->is.pivot, pivot);
    for (a = 0; a < 3; a++) d[a] = p[a] - pivot[a];
    for (a = 0; a < 3; a++)
        x[a] = GS4I_C((double)b->axes[3 * a] * d[0] + (double)b->axes[3 * a + 1] * d[1]
                      + (double)b->axes[3 * a + 2] * d[2] + b->at[a]);
}

/* Signed distance (m) from the body's surface to the world point p. */
static gs4_real gs4i_collider_distance(const gs4i_collider *b, gs4_vec3 p)
{
    return gs4i_shape_or_field(b, gs4i_to_collider(b, p));
}

/* gs4i_shape_is_flat for a body, of world points. */
static int gs4i_collider_is_flat(const gs4i_collider *b, gs4_vec3 p, gs4_real reach, gs4_real deep,
                                 gs4_vec3 *normal)
{
    gs4_vec3 n;
    if (!gs4i_shape_is_flat(&b->is.shape, gs4i_to_collider(b, p), reach, deep, &n)) return 0;
    *normal = gs4i_turned(b, n);
    return 1;
}

/* Outward unit normal: gradient of the distance over `step`; zero where it has none. */
static gs4_vec3 gs4i_collider_normal(const gs4i_collider *b, gs4_vec3 p, gs4_real step)
{
    gs4_vec3 g;
    gs4_real length;
    g.x = gs4i_collider_distance(b, gs4i_vec3(p.x + step, p.y, p.z))
          - gs4i_collider_distance(b, gs4i_vec3(p.x - step, p.y, p.z));
    g.y = gs4i_collider_distance(b, gs4i_vec3(p.x, p.y + step, p.z))
          - gs4i_collider_distance(b, gs4i_vec3(p.x, p.y - step, p.z));
    g.z = gs4i_collider_distance(b, gs4i_vec3(p.x, p.y, p.z + step))
          - gs4i_collider_distance(b, gs4i_vec3(p.x, p.y, p.z - step));
    length = gs4i_length(g);
    return length > 0 ? gs4i_scale(g, 1 / length) : gs4i_vec3(0, 0, 0);
}

/* --- closed triangle meshes: are they? -------------------------------------------------------- */

static void gs4i_mesh_corner(const gs4_shape *s, size_t i, double at[3])
{
    const gs4_real *v = s->vertices + 3 * (size_t)s->triangles[i];
    int a;
    for (a = 0; a < 3; a++) at[a] = (double)v[a];
}

/* For each vertex that a triangle has: 1 + the first one at the same place. NULL: out of memory. */
static int *gs4i_mesh_weld(gs4i_memory *m, const gs4_shape *s)
{
    size_t room = 4, i, at;
    int *table, *same, a;
    while (room < 2 * (size_t)s->vertex_count) room *= 2;
    table = (int *)gs4i_alloc(m, room, sizeof *table);
    same = (int *)gs4i_alloc(m, (size_t)s->vertex_count, sizeof *same);
    for (i = 0; table && same && i < 3 * (size_t)s->triangle_count; i++) {
        const int v = s->triangles[i];
        uint64_t key = 0;
        double x[3];
        if (same[v]) continue;
        gs4i_mesh_corner(s, i, x);
        for (a = 0; a < 3; a++) {
            uint64_t bits;
            x[a] += 0.0; /* -0 is 0 */
            memcpy(&bits, &x[a], sizeof bits);
            key = gs4i_mix(key ^ bits);
        }
        for (at = (size_t)key & (room - 1); table[at]; at = (at + 1) & (room - 1)) {
            const gs4_real *other = s->vertices + 3 * (size_t)(table[at] - 1);
            if ((double)other[0] == x[0] && (double)other[1] == x[1] && (double)other[2] == x[2])
                break;
        }
        if (!table[at]) table[at] = v + 1;
        same[v] = table[at];
    }
    if (!table) {
        gs4i_free(m, same, (size_t)s->vertex_count, sizeof *same);
        same = NULL;
    }
    gs4i_free(m, table, room, sizeof *table);
    return same;
}

/* From corner i round its triangle: the ends of the edge, lower one first. 1: it goes up, -1: down,
 * 0: it has no length. */
static int gs4i_mesh_edge(const gs4_shape *s, const int *same, size_t i, int ends[2])
{
    const int from = same[s->triangles[i]] - 1,
              to = same[s->triangles[i % 3 == 2 ? i - 2 : i + 1]] - 1;
    ends[0] = from < to ? from : to;
    ends[1] = from < to ? to : from;
    return (from < to) - (from > to);
}

/* Closed is a mesh whose edges are gone along as often one way as the other: then, and only then,
 * every point has a winding number. Ends of an edge where it is not so. 1: there is one, 0: there
 * is none, -1: out of memory. */
static int gs4i_mesh_open_edge(gs4i_memory *m, const gs4_shape *s, const int *same, int open[2])
{
    const size_t vertices = (size_t)s->vertex_count, edges = 3 * (size_t)s->triangle_count;
    /* upper ends of the edges of v, negative if they go down: upper[first[v]] to
     * upper[first[v + 1]] */
    size_t *first = (size_t *)gs4i_alloc(m, vertices + 2, sizeof *first), i, k;
    int *upper = (int *)gs4i_alloc(m, edges, sizeof *upper), ends[2], way,
        *balance = (int *)gs4i_alloc(m, vertices, sizeof *balance),
        result = first && upper && balance ? 0 : -1;
    for (i = 0; i < edges && result == 0; i++)
        if (gs4i_mesh_edge(s, same, i, ends)) first[ends[0] + 2]++;
    for (i = 2; i < vertices + 2 && result == 0; i++) first[i] += first[i - 1];
    for (i = 0; i < edges && result == 0; i++)
        if ((way = gs4i_mesh_edge(s, same, i, ends)) != 0)
            upper[first[ends[0] + 1]++] = way * (ends[1] + 1);
    for (i = 0; i < vertices && result == 0; i++) {
        for (k = first[i]; k < first[i + 1]; k++)
            balance[abs(upper[k]) - 1] += upper[k] > 0 ? 1 : -1;
        for (k = first[i]; k < first[i + 1] && result == 0; k++) {
            result = balance[abs(upper[k]) - 1] != 0;
            open[0] = (int)i;
            open[1] = abs(upper[k]) - 1;
        }
    }
    gs4i_free(m, first, vertices + 2, sizeof *first);
    gs4i_free(m, upper, edges, sizeof *upper);
    gs4i_free(m, balance, vertices, sizeof *balance);
    return result;
}

static int gs4i_fail_open(gs4i_error *e, const gs4_shape *s, const int *same, const int open[2])
{
    int ends[2], count[2] = { 0, 0 };
    size_t i, first = 0;
    gs4i_text t = gs4i_begin_error(e);
    for (i = 0; i < 3 * (size_t)s->triangle_count; i++) {
        const int way = gs4i_mesh_edge(s, same, i, ends);
        if (!way || ends[0] != open[0] || ends[1] != open[1]) continue;
        if (count[0] + count[1] == 0) first = i / 3;
        count[way > 0]++;
    }
    gs4i_put(&t, "shape: the mesh is not closed: along the edge of vertices ");
    gs4i_put_integer(&t, open[0]);
    gs4i_put(&t, " and ");
    gs4i_put_integer(&t, open[1]);
    gs4i_put(&t, " go ");
    gs4i_put_integer(&t, count[1]);
    gs4i_put(&t, " triangles one way and ");
    gs4i_put_integer(&t, count[0]);
    gs4i_put(&t, " the other, the first of them triangle ");
    gs4i_put_integer(&t, (int64_t)first);
    gs4i_put(&t, ": a hole, a T-junction, or triangles that disagree about the outside");
    return gs4i_end_error(e, GS4_ERROR_ARGUMENT);
}

static int gs4i_check_closed(gs4i_error *e, gs4i_memory *m, const gs4_shape *s)
{
    int *same = gs4i_mesh_weld(m, s), open[2] = { 0, 0 }, result = GS4_OK,
        found = same ? gs4i_mesh_open_edge(m, s, same, open) : -1;
    if (found) result = found < 0 ? gs4i_fail_memory(e) : gs4i_fail_open(e, s, same, open);
    gs4i_free(m, same, (size_t)s->vertex_count, sizeof *same);
    return result;
}

/* Enclosed volume, the sum of a . ((b - a) x (c - a)) / 6 over the triangles, below 0 inside out;
 * and their area. Places are taken from the first corner: far from the origin nothing cancels. */
static double gs4i_mesh_volume(const gs4_shape *s, double *area)
{
    double volume = 0, origin[3], a[3], b[3], c[3];
    size_t i;
    int k;
    *area = 0;
    gs4i_mesh_corner(s, 0, origin);
    for (i = 0; i < 3 * (size_t)s->triangle_count; i += 3) {
        double n[3], n2 = 0;
        gs4i_mesh_corner(s, i, a);
        gs4i_mesh_corner(s, i + 1, b);
        gs4i_mesh_corner(s, i + 2, c);
        for (k = 0; k < 3; k++) {
            const int l = (k + 1) % 3, r = (k + 2) % 3;
            n[k] = (b[l] - a[l]) * (c[r] - a[r]) - (b[r] - a[r]) * (c[l] - a[l]);
            n2 += n[k] * n[k];
            volume += (a[k] - origin[k]) * n[k] / 6;
        }
        *area += sqrt(n2) / 2;
    }
    return volume;
}

/* Indices in range and corners finite; a and b become the corners of the box around the mesh. */
static int gs4i_check_corners(gs4i_error *e, gs4_shape *s)
{
    gs4_real low[3] = { 0, 0, 0 }, high[3] = { 0, 0, 0 };
    size_t i;
    int a, is_finite = 1;
    for (i = 0; i < 3 * (size_t)s->triangle_count && is_finite; i++) {
        const int v = s->triangles[i];
        GS4I_TRY(gs4i_require_value(e, v >= 0 && v < s->vertex_count,
                                    "shape: the mesh has no vertex ", v,
                                    ", which one of its triangles has: the index is out of range"));
        for (a = 0; a < 3; a++) {
            const gs4_real x = s->vertices[3 * (size_t)v + (size_t)a];
            is_finite = is_finite && gs4i_finite(x) && gs4i_abs(x) < GS4I_HUGE;
            low[a] = i ? gs4i_min(low[a], x) : x;
            high[a] = i ? gs4i_max(high[a], x) : x;
        }
        GS4I_TRY(gs4i_require_value(e, is_finite, "shape: vertex ", v,
                                    " of the mesh is not finite, or absurdly far away"));
    }
    s->a = gs4i_vec3(low[0], low[1], low[2]);
    s->b = gs4i_vec3(high[0], high[1], high[2]);
    return GS4_OK;
}

/* Closed, faces outwards as a whole, and encloses more than rounding. */
static int gs4i_check_mesh(gs4i_error *e, gs4i_memory *m, gs4_shape *s)
{
    double area, volume;
    GS4I_TRY(gs4i_require(
        e, s->vertices && s->triangles && s->vertex_count >= 4 && s->triangle_count >= 4,
        "shape: a mesh needs vertices and triangles, at least four of each"));
    GS4I_TRY(gs4i_check_corners(e, s));
    GS4I_TRY(gs4i_check_closed(e, m, s));
    volume = gs4i_mesh_volume(s, &area);
    GS4I_TRY(gs4i_require(e,
                          fabs(volume) > 1e-12 * area * (double)gs4i_length(gs4i_sub(s->b, s->a)),
                          "shape: the mesh encloses no volume"));
    return gs4i_require(e, volume > 0,
                        "shape: the mesh is inside out: its triangles face inwards; swap two "
                        "vertices of each");
}

/* A body as thin as that slips between samples. Of a plate 2 volume / area is the thickness, of a
 * ball two thirds of its radius. */
static int gs4i_check_thickness(gs4i_error *e, const gs4_shape *s, double h)
{
    double area, thickness = 2 * gs4i_mesh_volume(s, &area);
    thickness /= area;
    return gs4i_require_value(e, thickness > 0.3 * h, "shape: the mesh is on average ", thickness,
                              " m thick, below 0.3 cells: material would pass through it; use "
                              "smaller cells or a thicker mesh");
}

/* --- distances to triangles ------------------------------------------------------------------- */

/* Squared distance of p to triangle abc: Voronoi regions of corners, edges and face. */
static double gs4i_triangle_distance2(const double p[3], const double a[3], const double b[3],
                                      const double c[3])
{
    double ab[3], ac[3], ap[3], q[3], d1 = 0, d2 = 0, d3, d4, d5, d6, va, vb, vc, u = 0, v = 0,
                                      bb = 0, bc = 0, cc = 0, r = 0;
    int i;
    for (i = 0; i < 3; i++) {
        ab[i] = b[i] - a[i];
        ac[i] = c[i] - a[i];
        ap[i] = p[i] - a[i];
        d1 += ab[i] * ap[i];
        d2 += ac[i] * ap[i];
        bb += ab[i] * ab[i];
        bc += ab[i] * ac[i];
        cc += ac[i] * ac[i];
    }
    /* the same from b and from c */
    d3 = d1 - bb;
    d4 = d2 - bc;
    d5 = d1 - bc;
    d6 = d2 - cc;
    va = d3 * d6 - d5 * d4;
    vb = d5 * d2 - d1 * d6;
    vc = d1 * d4 - d3 * d2;
    if (d1 <= 0 && d2 <= 0) {
        u = 0;
        v = 0;
    } else if (d3 >= 0 && d4 <= d3) {
        u = 1;
        v = 0;
    } else if (d6 >= 0 && d5 <= d6) {
        u = 0;
        v = 1;
    } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
        u = d1 / (d1 - d3);
        v = 0;
    } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
        u = 0;
        v = d2 / (d2 - d6);
    } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
        v = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        u = 1 - v;
    } else if (va + vb + vc > 0) {
        u = vb / (va + vb + vc);
        v = vc / (va + vb + vc);
    }
    for (i = 0; i < 3; i++) {
        q[i] = a[i] + u * ab[i] + v * ac[i] - p[i];
        r += q[i] * q[i];
    }
    return r;
}

static double gs4i_segment_distance2(const double p[3], const double a[3], const double b[3])
{
    double along = 0, length2 = 0, r = 0;
    int i;
    for (i = 0; i < 3; i++) {
        along += (b[i] - a[i]) * (p[i] - a[i]);
        length2 += (b[i] - a[i]) * (b[i] - a[i]);
    }
    along = length2 > 0 ? gs4i_greater(0, gs4i_lesser(along / length2, 1)) : 0;
    for (i = 0; i < 3; i++) {
        const double q = a[i] + along * (b[i] - a[i]) - p[i];
        r += q * q;
    }
    return r;
}

/* A triangle to be asked for many distances. Its planes have unit normals and go through the first
 * corner, but for that of the side opposite to it, which is `beyond`. A needle has no planes that
 * rounding has not turned: it is its sides. */
typedef struct gs4i_facet {
    double corner[3][3], low[3], high[3];
    double plane[4][3], beyond; /* of the face; of the sides, in the face and outwards */
    double slack;               /* m, more than all rounding */
    int is_needle;
} gs4i_facet;

static void gs4i_cross_double(const double a[3], const double b[3], double scale, double out[3])
{
    int k;
    for (k = 0; k < 3; k++)
        out[k] = scale * (a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]);
}

static double gs4i_dot_double(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void gs4i_facet_corners(const gs4_shape *s, size_t t, int first, double corner[3][3])
{
    int i;
    for (i = 0; i < 3; i++) gs4i_mesh_corner(s, 3 * t + (size_t)((first + i) % 3), corner[i]);
}

/* From which corner is it known best: one whose angle is not below 1e-5; 3: a needle. And its
 * sides from there, the normal of the first and the last, and the square of that. */
static int gs4i_facet_form(const gs4_shape *s, size_t t, double side[3][3], double n[3], double *n2)
{
    double corner[3][3];
    int i, a, first;
    for (first = 0; first < 3; first++) {
        gs4i_facet_corners(s, t, first, corner);
        for (i = 0; i < 3; i++)
            for (a = 0; a < 3; a++) side[i][a] = corner[(i + 1) % 3][a] - corner[i][a];
        gs4i_cross_double(side[0], side[1], 1, n);
        *n2 = gs4i_dot_double(n, n);
        if (*n2 > 1e-10 * gs4i_dot_double(side[0], side[0]) * gs4i_dot_double(side[2], side[2]))
            return first;
    }
    return 3;
}

static void gs4i_make_facet(const gs4_shape *s, int t, double spacing, gs4i_facet *f)
{
    double side[3][3], n[3], n2, size = 0;
    const int first = gs4i_facet_form(s, (size_t)t, side, n, &n2);
    int i, a;
    f->is_needle = first == 3;
    gs4i_facet_corners(s, (size_t)t, first, f->corner);
    for (a = 0; a < 3; a++) {
        f->low[a] = gs4i_lesser(f->corner[0][a], gs4i_lesser(f->corner[1][a], f->corner[2][a]));
        f->high[a] = gs4i_greater(f->corner[0][a], gs4i_greater(f->corner[1][a], f->corner[2][a]));
        size += f->high[a] - f->low[a];
    }
    f->slack = 1e-9 * size + 1e-6 * spacing;
    if (f->is_needle) return;
    for (a = 0; a < 3; a++) f->plane[0][a] = n[a] / sqrt(n2);
    for (i = 0; i < 3; i++)
        gs4i_cross_double(side[i], f->plane[0], 1 / sqrt(gs4i_dot_double(side[i], side[i])),
                          f->plane[i + 1]);
    f->beyond = gs4i_dot_double(f->plane[2], side[0]);
}

static double gs4i_corners_distance2(const double c[3][3], int is_needle, const double p[3])
{
    if (!is_needle) return gs4i_triangle_distance2(p, c[0], c[1], c[2]);
    return gs4i_lesser(
        gs4i_segment_distance2(p, c[0], c[1]),
        gs4i_lesser(gs4i_segment_distance2(p, c[1], c[2]), gs4i_segment_distance2(p, c[2], c[0])));
}

static double gs4i_facet_distance2(const gs4i_facet *f, const double p[3])
{
    return gs4i_corners_distance2(f->corner, f->is_needle, p);
}

/* The same or less, quickly: exact where a face or a side is nearest. */
static double gs4i_facet_bound2(const gs4i_facet *f, const double p[3])
{
    double r[3], face, side = 0;
    int a, i;
    if (f->is_needle) return gs4i_facet_distance2(f, p);
    for (a = 0; a < 3; a++) r[a] = p[a] - f->corner[0][a];
    face = gs4i_dot_double(f->plane[0], r);
    for (i = 1; i < 4; i++) {
        const double beyond = gs4i_dot_double(f->plane[i], r) - (i == 2 ? f->beyond : 0);
        if (beyond > side) side = beyond;
    }
    return face * face + side * side;
}

/* Is a point of the triangle within `reach` (m) of p? At least where it is. */
GS4I_INLINE int gs4i_facet_is_near(const gs4i_facet *f, const double p[3], double reach)
{
    reach += f->slack;
    return gs4i_facet_bound2(f, p) < reach * reach;
}

/* --- which triangle is nearest ---------------------------------------------------------------- */

/* A binary tree: node 1 has all triangles, 2 n and 2 n + 1 have the halves of what n has, on both
 * sides of a plane. The box around them is turned as they are: a slanted fan of needles would fill
 * one along the axes, and be near to all in it. */
typedef struct gs4i_facet_node {
    double axis[3][3], low[3], high[3]; /* the box along unit axes */
} gs4i_facet_node;

typedef struct gs4i_facet_tree {
    const gs4_shape *shape;
    gs4i_facet_node *node;
    size_t *facet; /* 4 times a triangle and its form, by place */
    int levels;    /* at the last one nodes have at most 4 triangles */
    double spacing;
} gs4i_facet_tree;

/* Where the triangles of a node begin; those of the next begin where they end. */
GS4I_INLINE size_t gs4i_facets_of(const gs4i_facet_tree *t, int level, int node)
{
    const int n = node - (1 << level);
    return (size_t)(((int64_t)t->shape->triangle_count * n) >> level);
}

/* Three times the centre of a triangle. */
static double gs4i_facet_centre(const gs4i_facet_tree *t, size_t i, int axis)
{
    const size_t first = 3 * (t->facet[i] / 4);
    double sum = 0;
    int k;
    for (k = 0; k < 3; k++)
        sum += (double)t->shape
                   ->vertices[3 * (size_t)t->shape->triangles[first + (size_t)k] + (size_t)axis];
    return sum;
}

/* Those of [begin, end) whose centres are lower along an axis come before `middle`: quickselect.
 * Its pivots are scattered: centres of a fan rise and fall, and its middle is an extreme. */
static void gs4i_facet_split(gs4i_facet_tree *t, size_t begin, size_t middle, size_t end, int axis)
{
    while (end - begin > 1) {
        const double pivot =
            gs4i_facet_centre(t, begin + (size_t)gs4i_mix(end) % (end - begin), axis);
        size_t i = begin, j = end; /* [begin, i) is not above the pivot, [j, end) not below */
        while (i < j) {
            while (gs4i_facet_centre(t, i, axis) < pivot) i++;
            while (gs4i_facet_centre(t, j - 1, axis) > pivot) j--;
            if (i < j) {
                const size_t swap = t->facet[i];
                t->facet[i++] = t->facet[j - 1];
                t->facet[--j] = swap;
            }
        }
        if (middle < j)
            end = j;
        else if (middle >= i)
            begin = i;
        else
            return;
    }
}

/* Along the longest side, the vector area across it, and what is normal to both; any axes do. */
static void gs4i_facet_axes(const gs4i_facet_tree *t, size_t begin, size_t end, double axis[3][3])
{
    double longest = 0, area[3] = { 0, 0, 0 }, side[3][3], n[3], n2, along;
    size_t i;
    int k, a, least = 0;
    for (a = 0; a < 3; a++) axis[0][a] = a == 0;
    for (i = begin; i < end; i++) {
        gs4i_facet_form(t->shape, t->facet[i] / 4, side, n, &n2);
        for (a = 0; a < 3; a++) area[a] += n[a];
        for (k = 0; k < 3; k++) {
            n2 = gs4i_dot_double(side[k], side[k]);
            if (n2 <= longest) continue;
            for (longest = n2, a = 0; a < 3; a++) axis[0][a] = side[k][a] / sqrt(n2);
        }
    }
    for (a = 1; a < 3; a++)
        if (fabs(axis[0][a]) < fabs(axis[0][least])) least = a;
    n2 = gs4i_dot_double(area, area);
    along = gs4i_dot_double(area, axis[0]);
    if (n2 - along * along <= 1e-6 * n2) { /* none across it */
        for (a = 0; a < 3; a++) area[a] = a == least;
        along = axis[0][least];
    }
    for (a = 0; a < 3; a++) area[a] -= along * axis[0][a];
    n2 = sqrt(gs4i_dot_double(area, area));
    for (a = 0; a < 3; a++) axis[1][a] = area[a] / n2;
    gs4i_cross_double(axis[0], axis[1], 1, axis[2]);
}

static void gs4i_build_node(gs4i_facet_tree *t, int level, int node)
{
    const size_t begin = gs4i_facets_of(t, level, node), end = gs4i_facets_of(t, level, node + 1);
    gs4i_facet_node *q = t->node + node;
    double c[3][3], low[3], high[3];
    size_t i;
    int k, a, longest = 0;
    gs4i_facet_axes(t, begin, end, q->axis);
    for (a = 0; a < 3; a++) {
        q->low[a] = low[a] = DBL_MAX;
        q->high[a] = high[a] = -DBL_MAX;
    }
    for (i = begin; i < end; i++) {
        gs4i_facet_corners(t->shape, t->facet[i] / 4, 0, c);
        for (a = 0; a < 3; a++) {
            const double centre = c[0][a] + c[1][a] + c[2][a];
            low[a] = gs4i_lesser(low[a], centre);
            high[a] = gs4i_greater(high[a], centre);
            for (k = 0; k < 3; k++) {
                const double x = gs4i_dot_double(q->axis[a], c[k]);
                q->low[a] = gs4i_lesser(q->low[a], x);
                q->high[a] = gs4i_greater(q->high[a], x);
            }
        }
    }
    for (a = 0; a < 3; a++) {
        const double slack =
            1e-6 * t->spacing + 1e-12 * gs4i_greater(fabs(q->low[a]), fabs(q->high[a]));
        q->low[a] -= slack;
        q->high[a] += slack;
        if (high[a] - low[a] > high[longest] - low[longest]) longest = a;
    }
    if (level == t->levels) return;
    gs4i_facet_split(t, begin, gs4i_facets_of(t, level + 1, 2 * node + 1), end, longest);
    gs4i_build_node(t, level + 1, 2 * node);
    gs4i_build_node(t, level + 1, 2 * node + 1);
}

static void gs4i_free_facets(gs4i_memory *m, gs4i_facet_tree *t)
{
    gs4i_free(m, t->facet, (size_t)t->shape->triangle_count, sizeof *t->facet);
    gs4i_free(m, t->node, (size_t)2 << t->levels, sizeof *t->node);
}

static int gs4i_build_facets(gs4i_memory *m, gs4i_facet_tree *t, const gs4_shape *s, double spacing)
{
    double side[3][3], n[3], n2;
    size_t i;
    t->shape = s;
    t->spacing = spacing;
    t->levels = 0;
    while (s->triangle_count - 1 >= 4 << t->levels) t->levels++;
    t->facet = (size_t *)gs4i_alloc(m, (size_t)s->triangle_count, sizeof *t->facet);
    t->node = (gs4i_facet_node *)gs4i_alloc(m, (size_t)2 << t->levels, sizeof *t->node);
    if (!t->facet || !t->node) return 0;
    for (i = 0; i < (size_t)s->triangle_count; i++)
        t->facet[i] = 4 * i + (size_t)gs4i_facet_form(s, i, side, n, &n2);
    gs4i_build_node(t, 0, 1);
    return 1;
}

/* Squared distance to the box of a node. */
GS4I_INLINE double gs4i_node_distance2(const gs4i_facet_node *q, const double p[3])
{
    double r2 = 0;
    int a;
    for (a = 0; a < 3; a++) {
        const double x = gs4i_dot_double(q->axis[a], p), below = q->low[a] - x,
                     above = x - q->high[a];
        const double gap = gs4i_greater(gs4i_greater(below, above), 0);
        r2 += gap * gap;
    }
    return r2;
}

/* The squared distance of p from the triangles of a node, or r2 if that is less. */
static double gs4i_nearest2(const gs4i_facet_tree *t, int level, int node, const double p[3],
                            double r2)
{
    double child[2];
    size_t i;
    int k, first;
    if (level == t->levels) {
        const size_t end = gs4i_facets_of(t, level, node + 1);
        for (i = gs4i_facets_of(t, level, node); i < end; i++) {
            const int form = (int)(t->facet[i] % 4);
            double c[3][3], now;
            gs4i_facet_corners(t->shape, t->facet[i] / 4, form, c);
            now = gs4i_corners_distance2((const double(*)[3])c, form == 3, p);
            if (now < r2) r2 = now;
        }
        return r2;
    }
    for (k = 0; k < 2; k++) child[k] = gs4i_node_distance2(t->node + 2 * node + k, p);
    first = child[1] < child[0];
    for (k = 0; k < 2; k++)
        if (child[first ^ k] < r2) r2 = gs4i_nearest2(t, level + 1, 2 * node + (first ^ k), p, r2);
    return r2;
}

/* --- sampled distance of a mesh --------------------------------------------------------------- */

/* First and last sample of the window that is, along `axis`, in the box of the triangle or `margin`
 * (m) around it. */
static void gs4i_field_range(const gs4i_field *f, const gs4i_facet *t, int axis, double margin,
                             int range[2])
{
    const double first = 8 * f->first[axis], last = first + 8 * f->blocks[axis] - 1;
    range[0] = (int)gs4i_lesser(
        gs4i_greater(ceil((t->low[axis] - margin - f->low[axis]) / f->spacing), first), last + 1);
    range[1] = (int)gs4i_greater(
        gs4i_lesser(floor((t->high[axis] + margin - f->low[axis]) / f->spacing), last), first - 1);
}

static void gs4i_field_place(const gs4i_field *f, double i, double j, double k, double p[3])
{
    p[0] = f->low[0] + i * f->spacing;
    p[1] = f->low[1] + j * f->spacing;
    p[2] = f->low[2] + k * f->spacing;
}

/* Has the block that begins at sample i, j, k one within `band` of the triangle? */
static int gs4i_field_block_is_near(const gs4i_field *f, const gs4i_facet *t, int i, int j, int k)
{
    double midst[3];
    gs4i_field_place(f, i + 3.5, j + 3.5, k + 3.5, midst);
    return gs4i_facet_is_near(t, midst, f->band + 3.5 * sqrt(3.0) * f->spacing);
}

/* Blocks near a triangle will have samples. */
static void gs4i_field_mark(gs4i_field *f, const gs4i_facet *t)
{
    int range[3][2], i, j, k, a;
    for (a = 0; a < 3; a++) gs4i_field_range(f, t, a, f->band, range[a]);
    if (range[0][0] > range[0][1]) return;
    for (k = range[2][0] & ~7; k <= range[2][1]; k += 8)
        for (j = range[1][0] & ~7; j <= range[1][1]; j += 8)
            for (i = range[0][0] & ~7; i <= range[0][1]; i += 8) {
                int32_t *block = &f->block[gs4i_field_block_of(f, i, j, k)];
                if (*block < 0 && gs4i_field_block_is_near(f, t, i, j, k)) *block = 0;
            }
}

/* Distances of the samples of the block that begins at sample i, j, k; `band` stays beyond it, and
 * signs stay. On a path from one to the next: there it is one spacing farther at most. */
static void gs4i_field_measure(const gs4i_field *f, const gs4i_facet_tree *t, int i, int j, int k)
{
    const int32_t block = f->block[gs4i_field_block_of(f, i, j, k)];
    double distance = f->band, p[3];
    int n;
    for (n = 0; n < GS4I_FIELD_BLOCK; n++) {
        const int x = n & 7, y = n >> 3 & 7, z = n >> 6;
        const int at[3] = { i + (y & 1 ? 7 - x : x), j + (z & 1 ? 7 - y : y), k + z };
        const double most = gs4i_lesser(f->band, distance + 1.001 * f->spacing);
        gs4_real *d = gs4i_field_sample(f, block, at[0], at[1], at[2]);
        gs4i_field_place(f, at[0], at[1], at[2], p);
        distance = sqrt(gs4i_nearest2(t, 0, 1, p, most * most));
        if (distance < f->band) *d = GS4I_C(*d < 0 ? -distance : distance);
    }
}

/* By how much does the winding number grow along x where the line at (y, z) crosses the triangle,
 * and where is that? It is minus the winding number of its projection: edges that cross the ray
 * from (y, z) to large y. What an edge adds depends on its ends alone, so that a closed mesh adds
 * up to 0 on every line, whatever is rounded. */
static int gs4i_facet_crossing(const gs4i_facet *t, double y, double z, double *x)
{
    double at_x[2] = { 0, 0 }, at_y[2] = { 0, 0 }; /* of the edges at z: beyond y, and not */
    int i, winding = 0;
    for (i = 0; i < 3; i++) {
        const double *from = t->corner[i], *to = t->corner[(i + 1) % 3];
        const int rises = to[2] > z;
        const double *low = rises ? from : to, *high = rises ? to : from;
        double along;
        int side;
        if (rises == (from[2] > z)) continue;
        along = (z - low[2]) / (high[2] - low[2]);
        side = (low[1] - y) * (high[2] - z) - (high[1] - y) * (low[2] - z) > 0;
        at_x[side] = low[0] + along * (high[0] - low[0]);
        at_y[side] = low[1] + along * (high[1] - low[1]);
        if (side) winding += rises ? 1 : -1;
    }
    if (winding == 0) return 0;
    *x = at_x[0];
    if (at_y[1] > at_y[0])
        *x += gs4i_greater(0, gs4i_lesser((y - at_y[0]) / (at_y[1] - at_y[0]), 1))
              * (at_x[1] - at_x[0]);
    return -winding;
}

/* The changes of the winding number along x, of each sample to the one before it, as `distance`;
 * of the first ones of the window as `rows`. */
static void gs4i_field_count_crossings(const gs4i_field *f, const gs4i_facet *t, int32_t *rows)
{
    const int first = 8 * f->first[0], end = first + 8 * f->blocks[0];
    int y[2], z[2], j, k, grows;
    double p[3], x = 0;
    gs4i_field_range(f, t, 1, f->spacing, y);
    gs4i_field_range(f, t, 2, f->spacing, z);
    for (k = z[0]; k <= z[1]; k++)
        for (j = y[0]; j <= y[1]; j++) {
            gs4i_field_place(f, 0, j, k, p);
            grows = gs4i_facet_crossing(t, p[1], p[2], &x);
            x = ceil((x - p[0]) / f->spacing);
            if (!grows || x >= end) continue;
            if (x <= first)
                rows[(k - 8 * f->first[2]) * 8 * f->blocks[1] + j - 8 * f->first[1]] += grows;
            else {
                const int i = (int)x;
                const int32_t block = f->block[gs4i_field_block_of(f, i, j, k)];
                *gs4i_field_sample(f, block, i, j, k) += GS4I_C(grows);
            }
        }
}

/* Changes of winding numbers along a row become signs of `band`. Returns a sample where the number
 * is negative at two side by side, or -1: less may be rounding where surfaces touch. */
static int gs4i_field_sweep(gs4i_field *f, int j, int k, int winding)
{
    const int first = 8 * f->first[0], end = first + 8 * f->blocks[0];
    int i, c, negative = 0, wrong = -1;
    for (i = first; i < end; i += 8) {
        int32_t *block = &f->block[gs4i_field_block_of(f, i, j, k)];
        if (*block >= 0) {
            gs4_real *d = gs4i_field_sample(f, *block, i, j, k);
            for (c = 0; c < 8; c++) {
                winding += (int)d[c];
                negative = winding < 0 ? negative + 1 : 0;
                if (negative > 1) wrong = i + c;
                d[c] = GS4I_C(winding > 0 ? -f->band : f->band);
            }
        } else if (winding < 0)
            wrong = i;
        else if (winding > 0 && j % 8 == 0 && k % 8 == 0)
            *block = GS4I_FIELD_INSIDE;
    }
    return wrong;
}

/* "near (x, y, z)", and the triangle nearest to there. */
static int gs4i_fail_inverted(gs4i_error *e, const gs4i_field *f, const gs4_shape *s,
                              const int wrong[3])
{
    gs4i_text text = gs4i_begin_error(e);
    double p[3], least = DBL_MAX;
    int t, a, nearest = 0;
    gs4i_field_place(f, wrong[0], wrong[1], wrong[2], p);
    for (t = 0; t < s->triangle_count; t++) {
        gs4i_facet facet;
        double r2;
        gs4i_make_facet(s, t, f->spacing, &facet);
        r2 = gs4i_facet_distance2(&facet, p);
        if (r2 < least) nearest = t;
        least = fmin(least, r2);
    }
    gs4i_put(&text, "shape: a part of the mesh is inside out: near (");
    for (a = 0; a < 3; a++) {
        gs4i_put_real(&text, p[a]);
        gs4i_put(&text, a < 2 ? ", " : "), where triangle ");
    }
    gs4i_put_integer(&text, nearest);
    gs4i_put(&text, " is, its triangles face inwards; swap two vertices of each of that part");
    return gs4i_end_error(e, GS4_ERROR_ARGUMENT);
}

static void gs4i_field_free(gs4i_memory *m, gs4i_field *f)
{
    gs4i_free(m, f->block, (size_t)f->blocks[0] * (size_t)f->blocks[1] * (size_t)f->blocks[2],
              sizeof *f->block);
    gs4i_free(m, f->distance, (size_t)f->count * GS4I_FIELD_BLOCK, sizeof *f->distance);
    f->block = NULL;
    f->distance = NULL;
}

/* Those of all blocks. 0: out of memory. */
static int gs4i_field_measure_all(gs4i_memory *m, const gs4i_field *f, const gs4_shape *s)
{
    gs4i_facet_tree t;
    const int begun = gs4i_build_facets(m, &t, s, f->spacing);
    int i, j, k;
    for (k = f->first[2]; begun && k < f->first[2] + f->blocks[2]; k++)
        for (j = f->first[1]; j < f->first[1] + f->blocks[1]; j++)
            for (i = f->first[0]; i < f->first[0] + f->blocks[0]; i++)
                if (f->block[gs4i_field_block_of(f, 8 * i, 8 * j, 8 * k)] >= 0)
                    gs4i_field_measure(f, &t, 8 * i, 8 * j, 8 * k);
    gs4i_free_facets(m, &t);
    return begun;
}

/* The samples of a window that is open. */
static int gs4i_field_sample_mesh(gs4i_error *e, gs4i_memory *m, gs4i_field *f, const gs4_shape *s)
{
    const int width = 8 * f->blocks[1], depth = 8 * f->blocks[2];
    int32_t *rows = (int32_t *)gs4i_alloc(m, (size_t)width * (size_t)depth, sizeof *rows);
    gs4i_facet facet;
    int t, i, code, wrong[3] = { -1, 0, 0 };
    f->distance =
        (gs4_real *)gs4i_alloc(m, (size_t)f->count * GS4I_FIELD_BLOCK, sizeof *f->distance);
    code = rows && f->distance ? GS4_OK : gs4i_fail_memory(e);
    for (t = 0; code == GS4_OK && t < s->triangle_count; t++) {
        gs4i_make_facet(s, t, f->spacing, &facet);
        gs4i_field_count_crossings(f, &facet, rows);
    }
    for (i = 0; code == GS4_OK && i < width * depth; i++) {
        wrong[1] = 8 * f->first[1] + i % width;
        wrong[2] = 8 * f->first[2] + i / width;
        wrong[0] = gs4i_field_sweep(f, wrong[1], wrong[2], rows[i]);
        if (wrong[0] >= 0) code = gs4i_fail_inverted(e, f, s, wrong);
    }
    gs4i_free(m, rows, (size_t)width * (size_t)depth, sizeof *rows);
    if (code == GS4_OK && !gs4i_field_measure_all(m, f, s)) code = gs4i_fail_memory(e);
    if (code < 0) gs4i_field_free(m, f);
    return code;
}

/* --- the part of a mesh that the domain meets ------------------------------------------------- */

/* Bytes of the samples of a body at most; of all of a body that moves, or of more than two a cell,
 * at most: chosen */
#define GS4I_FIELD_MOST 1e9
#define GS4I_FIELD_WHOLE 32e6
/* cells around the domain where distances are asked for: a particle within 3 cells of a surface has
 * an image as far behind it, and was moved by 2 before */
#define GS4I_FIELD_MARGIN 10
#define GS4I_FIELD_AHEAD 8 /* cells by which a body may move until it is sampled anew; chosen */

/* The window that the domain and so many cells around it can reach. */
static void gs4i_field_reach(const gs4i_collider *b, const gs4i_grid *g, double cells, int first[3],
                             int last[3])
{
    const gs4i_field *f = &b->field;
    const double h = (double)g->h;
    double origin[3], pivot[3], low[3], high[3];
    int corner, a, c;
    gs4i_to_double(g->origin, origin);
    gs4i_to_double(b->is.pivot, pivot);
    for (corner = 0; corner < 8; corner++)
        for (a = 0; a < 3; a++) {
            double x = pivot[a];
            for (c = 0; c < 3; c++)
                x +=
                    (double)b->axes[3 * c + a]
                    * (origin[c] + (corner >> c & 1 ? g->cells[c] + cells : -cells) * h - b->at[c]);
            x = floor((x - f->low[a]) / f->spacing);
            low[a] = corner ? fmin(low[a], x) : x;
            high[a] = corner ? fmax(high[a], x) : x;
        }
    for (a = 0; a < 3; a++) {
        first[a] = (int)fmax(0, fmin(low[a], f->n[a] - 2)) / 8;
        last[a] = (int)fmax(1, fmin(high[a] + 1, f->n[a] - 1)) / 8;
    }
}

/* Open a window and find its blocks near the surface. The bytes that it takes, with those of
 * samples; where they are more than `most` it is closed again. -1: out of memory. */
static double gs4i_field_open(gs4i_memory *m, gs4i_field *f, const gs4_shape *s, const int first[3],
                              const int last[3], double most)
{
    double bytes = sizeof *f->block;
    size_t i, blocks = 1;
    int a, t;
    for (a = 0; a < 3; a++) {
        f->first[a] = first[a];
        f->blocks[a] = last[a] - first[a] + 1;
        bytes *= f->blocks[a];
    }
    bytes += 64 * sizeof(int32_t) * (double)f->blocks[1] * f->blocks[2]; /* rows */
    if (bytes > most) return bytes;
    for (a = 0; a < 3; a++) blocks *= (size_t)f->blocks[a];
    f->block = (int32_t *)gs4i_alloc(m, blocks, sizeof *f->block);
    if (!f->block) return -1;
    for (i = 0; i < blocks; i++) f->block[i] = GS4I_FIELD_OUTSIDE;
    for (t = 0; t < s->triangle_count; t++) {
        gs4i_facet facet;
        gs4i_make_facet(s, t, f->spacing, &facet);
        gs4i_field_mark(f, &facet);
    }
    for (f->count = 0, i = 0; i < blocks; i++)
        if (f->block[i] >= 0) f->block[i] = f->count++;
    bytes += (double)f->count * GS4I_FIELD_BLOCK * sizeof *f->distance;
    if (bytes > most) gs4i_field_free(m, f);
    return bytes;
}

/* Open the window for a body where it is: of all of it where it moves and that is little; else of
 * what the domain reaches, and may reach soon. */
static double gs4i_field_open_for(gs4i_memory *m, gs4i_collider *b, const gs4i_grid *g, double most)
{
    const int moves = gs4i_is_moving(b);
    gs4i_field *f = &b->field;
    int first[3] = { 0, 0, 0 }, last[3], a;
    double bytes;
    for (a = 0; a < 3; a++) last[a] = (f->n[a] - 1) / 8;
    if (moves) {
        bytes = gs4i_field_open(m, f, &b->is.shape, first, last, GS4I_FIELD_WHOLE);
        if (bytes <= GS4I_FIELD_WHOLE) return bytes;
    }
    gs4i_field_reach(b, g, GS4I_FIELD_MARGIN + (moves ? GS4I_FIELD_AHEAD : 0), first, last);
    return gs4i_field_open(m, f, &b->is.shape, first, last, most);
}

static int gs4i_fail_window(gs4i_error *e, double bytes)
{
    if (bytes < 0) return gs4i_fail_memory(e);
    return gs4i_fail_value(e, GS4_ERROR_MEMORY,
                           "shape: distances to the surface of the mesh in the domain, two a cell, "
                           "would take ",
                           bytes, " bytes, above 1e9; use larger cells or a smaller mesh");
}

/* Samples `spacing` (m) apart, and seven around the mesh. */
static void gs4i_field_lay(gs4i_field *f, const gs4_shape *s, double spacing)
{
    double high[3];
    int a;
    gs4i_to_double(s->a, f->low);
    gs4i_to_double(s->b, high);
    f->spacing = spacing;
    f->band = 6 * spacing;
    for (a = 0; a < 3; a++) {
        f->n[a] = (int)ceil((high[a] - f->low[a]) / spacing) + 14;
        f->low[a] -= 6.49 * spacing; /* low faces of a box lie between samples */
    }
}

/* Sample the mesh of a body every `spacing` (m), at least twice a cell; coarser down to that where
 * it would be too much. */
static int gs4i_field_create(gs4i_error *e, gs4i_memory *m, gs4i_collider *b, const gs4i_grid *g,
                             double spacing)
{
    const gs4_shape *s = &b->is.shape;
    const gs4_vec3 size = gs4i_sub(s->b, s->a);
    const double half = 0.5 * (double)g->h,
                 extent = (double)gs4i_max(size.x, gs4i_max(size.y, size.z));
    double bytes, most;
    spacing = fmax(fmin(spacing, half), 1e-9 * extent);
    for (;;) {
        gs4i_field_lay(&b->field, s, spacing);
        most = spacing < half ? GS4I_FIELD_WHOLE : GS4I_FIELD_MOST;
        bytes = gs4i_field_open_for(m, b, g, most);
        if (bytes >= 0 && bytes <= most) break;
        if (bytes < 0 || spacing >= half) return gs4i_fail_window(e, bytes);
        spacing = fmin(1.1 * spacing, half);
    }
    return gs4i_field_sample_mesh(e, m, &b->field, s);
}

/* Sample anew where the domain has come to the end of what is sampled of a mesh. */
static int gs4i_field_follow(gs4i_error *e, gs4i_memory *m, gs4i_collider *b, const gs4i_grid *g)
{
    const gs4i_field *f = &b->field;
    int first[3], last[3], a, is_within = f->distance != NULL;
    double bytes;
    if (b->is.shape.kind != GS4_SHAPE_MESH) return GS4_OK;
    gs4i_field_reach(b, g, GS4I_FIELD_MARGIN, first, last);
    for (a = 0; a < 3; a++)
        is_within = is_within && first[a] >= f->first[a] && last[a] < f->first[a] + f->blocks[a];
    if (is_within) return GS4_OK;
    gs4i_field_free(m, &b->field);
    bytes = gs4i_field_open_for(m, b, g, GS4I_FIELD_MOST);
    if (bytes < 0 || bytes > GS4I_FIELD_MOST) return gs4i_fail_window(e, bytes);
    return gs4i_field_sample_mesh(e, m, &b->field, &b->is.shape);
}

/* --- images of the walls ---------------------------------------------------------------------- */

/* Mirror of node `at` (which is outside 0 .. n-1) at its wall. */
GS4I_INLINE int gs4i_mirrored(gs4_wall wall, int at, int n)
{
    if (wall == GS4_WALL_PERIODIC) return at < 0 ? at + n : at - n;
    return at < 0 ? -1 - at : 2 * n - 1 - at;
}

/* The mirror nodes of a wall in a block, behind what `list` has already; NULL: they are counted. */
static int gs4i_mirror_nodes_of(const gs4i_boundary *b, const gs4i_grid *g, int wall, int slot,
                                gs4i_mirror_pair *list)
{
    const int axis = wall / 2, n = g->cells[axis];
    int first[3], x[3], i, count = 0;
    gs4i_block_origin(g, g->block[slot], first);
    if (wall & 1 ? first[axis] + 3 < n : first[axis] >= 0) return 0;
    for (i = 0; i < GS4I_BLOCK_NODES; i++) {
        int64_t inner;
        gs4i_node_coordinates(first, i, x);
        if (wall & 1 ? x[axis] < n || x[axis] > n + 1 : x[axis] > -1 || x[axis] < -2) continue;
        x[axis] = gs4i_mirrored(b->walls[wall], x[axis], n);
        inner = gs4i_node_at(g, x[0], x[1], x[2]);
        if (inner < 0) continue;
        if (list) {
            list[count].mirror = gs4i_first_node(slot) + (uint32_t)i;
            list[count].inner = (uint32_t)inner;
        }
        count++;
    }
    return count;
}

/* List the pairs of every wall; called when the blocks have changed. */
static int gs4i_list_mirror_nodes(gs4i_memory *m, gs4i_boundary *b, const gs4i_grid *g)
{
    int wall, s;
    for (wall = 0; wall < 6; wall++) {
        int count = 0;
        if (b->walls[wall] == GS4_WALL_OPEN) continue;
        for (s = 0; s < g->active; s++) count += gs4i_mirror_nodes_of(b, g, wall, s, NULL);
        if (count > b->mirror_capacity[wall]) {
            int wanted = count + count / 4;
            gs4i_mirror_pair *list =
                (gs4i_mirror_pair *)gs4i_alloc(m, (size_t)wanted, sizeof *list);
            if (!list) return GS4_ERROR_MEMORY;
            gs4i_free(m, b->mirrors[wall], (size_t)b->mirror_capacity[wall], sizeof *list);
            b->mirrors[wall] = list;
            b->mirror_capacity[wall] = wanted;
        }
        for (count = 0, s = 0; b->mirrors[wall] && s < g->active; s++)
            count += gs4i_mirror_nodes_of(b, g, wall, s, b->mirrors[wall] + count);
        b->mirror_count[wall] = count;
    }
    return GS4_OK;
}

/* How far in front of a sticky body nodes are held that images do not serve, in cells: a plane
 * of nodes just in front would leave liquid next to no node to stick to. See gs4i_holds_node. */
#define GS4I_STICKY_REACH GS4I_C(0.75)
/* particles that have images are within so many cells of a surface; nodes that see one within
 * GS4I_IMAGE_NODES */
#define GS4I_IMAGE_REACH GS4I_C(3)
#define GS4I_IMAGE_NODES GS4I_C(1.5)

/* Can a body hold any node of a block? By its distance from the midst: half the diagonal of the
 * block's nodes, and its reach. */
static int gs4i_collider_is_near(const gs4i_collider *b, const gs4i_grid *g, int slot)
{
    return gs4i_collider_distance(b, gs4i_block_centre(g, g->block[slot]))
           < (GS4I_C(2.7) + GS4I_IMAGE_NODES) * g->h;
}

/* Give a place for jumps to the blocks that touch a wall or a collider. */
static int gs4i_place_jumps(gs4i_memory *m, const gs4i_boundary *b, gs4i_grid *g)
{
    int wall, i, s, n = 0;
    memset(g->jump_of, 0, (size_t)g->active * sizeof *g->jump_of);
    for (wall = 0; wall < 6; wall++)
        for (i = 0; i < b->mirror_count[wall] && b->walls[wall] < GS4_WALL_OPEN; i++) {
            g->jump_of[gs4i_slot_of(b->mirrors[wall][i].mirror)] = 1;
            g->jump_of[gs4i_slot_of(b->mirrors[wall][i].inner)] = 1;
        }
    for (i = 0; i < b->collider_count; i++)
        for (s = 0; s < g->active; s++)
            g->jump_of[s] = g->jump_of[s] || gs4i_collider_is_near(&b->colliders[i], g, s);
    for (s = 0; s < g->active; s++)
        if (g->jump_of[s]) g->jump_of[s] = ++n;
    g->jump_count = n;
    if (n > g->jump_capacity) {
        int wanted = n + n / 4;
        gs4_real *jump = (gs4_real *)gs4i_alloc(m, (size_t)wanted, GS4I_NODE_REALS * sizeof *jump);
        if (!jump) return GS4_ERROR_MEMORY;
        gs4i_free(m, g->jump, (size_t)g->jump_capacity, GS4I_NODE_REALS * sizeof *jump);
        g->jump = jump;
        g->jump_capacity = wanted;
    }
    return GS4_OK;
}

/* How a field continues behind a wall, number c of a node:
 *     mirror[c] = sign[c] inner[c] + shift[c] inner[by]       (by -1: + shift[c])
 * and how what was scattered to mirror nodes is folded back: inner[c] += the same of mirror. */
typedef struct gs4i_parity {
    gs4_real sign[4], shift[4];
    int by, reals; /* of the 4 numbers of a node the first `reals` continue */
    int always;    /* also where a separating wall is not in contact */
} gs4i_parity;

/* Parities of vectors at the six walls. Stick: odd; slip and separate: odd along the normal, even
 * along the wall; periodic: the same a period away. A fourth number is even. */
static void gs4i_vector_parity(const gs4i_boundary *b, int reals, gs4i_parity parity[6])
{
    int wall, c;
    memset(parity, 0, 6 * sizeof *parity);
    for (wall = 0; wall < 6; wall++) {
        const gs4_wall kind = b->walls[wall];
        for (c = 0; c < 4; c++)
            parity[wall].sign[c] = GS4I_C(c == 3 || kind == GS4_WALL_PERIODIC
                                                  || (kind != GS4_WALL_STICK && c != wall / 2)
                                              ? 1
                                              : -1);
        parity[wall].reals = reals;
        parity[wall].by = -1;
    }
}

/* Does this mirror node act in this step? */
GS4I_INLINE int gs4i_in_contact(const gs4i_boundary *b, const gs4i_grid *g,
                                const gs4i_mirror_pair *pair, int wall)
{
    return b->walls[wall] == GS4_WALL_PERIODIC || (g->flags[pair->mirror] >> (wall / 2) & 1);
}

GS4I_INLINE gs4_real gs4i_continued(const gs4i_parity *p, const gs4_real *from, int c)
{
    const gs4_real own = p->sign[c] * from[c];
    return p->shift[c] != 0 ? own + (p->by < 0 ? p->shift[c] : p->shift[c] * from[p->by]) : own;
}

/* Fold what reached the mirror nodes of one wall back. */
static void gs4i_fold_wall(const gs4i_boundary *b, const gs4i_grid *g, gs4_real *field, int wall,
                           const gs4i_parity *p)
{
    int i, c;
    for (i = 0; i < b->mirror_count[wall]; i++) {
        const gs4i_mirror_pair *pair = &b->mirrors[wall][i];
        const gs4_real *from = gs4i_of_node(field, pair->mirror);
        gs4_real *to = gs4i_of_node(field, pair->inner);
        if (!p->always && !gs4i_in_contact(b, g, pair, wall)) continue;
        for (c = 0; c < p->reals; c++) to[c] += gs4i_continued(p, from, c);
    }
}

/* Fold at all walls. */
static void gs4i_fold(const gs4i_boundary *b, const gs4i_grid *g, gs4_real *field,
                      const gs4i_parity parity[6])
{
    int wall;
    for (wall = 0; wall < 6; wall++) gs4i_fold_wall(b, g, field, wall, &parity[wall]);
}

/* Let mirror nodes continue a field; axes in the reverse order of folding. */
static void gs4i_fill(const gs4i_boundary *b, const gs4i_grid *g, gs4_real *field,
                      const gs4i_parity parity[6])
{
    int wall, i, c;
    for (wall = 5; wall >= 0; wall--)
        for (i = 0; i < b->mirror_count[wall]; i++) {
            const gs4i_parity *p = &parity[wall];
            const gs4i_mirror_pair *pair = &b->mirrors[wall][i];
            const gs4_real *from = gs4i_of_node(field, pair->inner);
            gs4_real *to = gs4i_of_node(field, pair->mirror);
            if (!p->always && !gs4i_in_contact(b, g, pair, wall)) continue;
            for (c = 0; c < p->reals; c++) to[c] = gs4i_continued(p, from, c);
        }
}

/* Find the mirror nodes of a wall that are in contact: all, but of a separating wall those where
 * material moves into it or pressed on it in the last step. */
static void gs4i_find_contact(const gs4i_boundary *b, const gs4i_grid *g, int wall)
{
    const int axis = wall / 2;
    const gs4_real outward = wall & 1 ? GS4I_C(1) : GS4I_C(-1);
    int i;
    if (b->walls[wall] == GS4_WALL_PERIODIC) return;
    for (i = 0; i < b->mirror_count[wall]; i++) {
        const gs4i_mirror_pair *pair = &b->mirrors[wall][i];
        const gs4_real into = (gs4i_of_node(g->momentum, pair->mirror)[axis]
                               + gs4i_of_node(g->momentum, pair->inner)[axis])
                              * outward;
        if (b->walls[wall] != GS4_WALL_SEPARATE || into > 0
            || g->flags[pair->mirror] & GS4I_WAS_PRESSED)
            g->flags[pair->mirror] |= (uint8_t)(1 << axis);
    }
}

/* Behind two walls, or behind one and a periodic one, a mirror node is in contact with each as
 * the node is that it mirrors in the other: so no axis comes first, and the seam is no place.
 * Once is enough, behind three walls too: there z takes from nodes that x and y have done. */
static void gs4i_share_contact(const gs4i_boundary *b, const gs4i_grid *g)
{
    int wall, i;
    for (wall = 0; wall < 6; wall++) {
        const uint8_t others = (uint8_t)(7 & ~(1 << wall / 2));
        for (i = 0; i < b->mirror_count[wall]; i++) {
            const gs4i_mirror_pair *pair = &b->mirrors[wall][i];
            uint8_t *flags = &g->flags[pair->mirror];
            *flags = (uint8_t)((*flags & ~others) | (g->flags[pair->inner] & others));
        }
    }
}

/* The jump of a mirror node in contact has 1 as fourth number; so it has at sticky colliders, see
 * gs4i_hold_nodes. */
static void gs4i_mark_contact(const gs4i_boundary *b, const gs4i_grid *g, int wall)
{
    int i;
    if (b->walls[wall] == GS4_WALL_PERIODIC) return;
    for (i = 0; i < b->mirror_count[wall]; i++)
        if (gs4i_in_contact(b, g, &b->mirrors[wall][i], wall))
            gs4i_jump_of_node(g, b->mirrors[wall][i].mirror)[3] = 1;
}

/* Fold mass and momentum; what is in contact is found on the way. Separating walls come last and
 * see all that the others reflect. */
static void gs4i_fold_momentum(const gs4i_boundary *b, const gs4i_grid *g)
{
    gs4i_parity parity[6];
    int separating, wall, any;
    gs4i_vector_parity(b, 4, parity);
    for (separating = 0; separating < 2; separating++) {
        for (any = wall = 0; wall < 6; wall++)
            if ((b->walls[wall] == GS4_WALL_SEPARATE) == separating) {
                gs4i_find_contact(b, g, wall);
                any = 1;
            }
        if (separating && any) gs4i_share_contact(b, g);
        for (wall = 0; wall < 6; wall++)
            if ((b->walls[wall] == GS4_WALL_SEPARATE) == separating) {
                gs4i_mark_contact(b, g, wall);
                gs4i_fold_wall(b, g, g->momentum, wall, &parity[wall]);
            }
    }
}

/* What pushes out of the domain presses on a separating wall, but where material leaves with ten
 * times (chosen) the impulse of that push in this step: there rounding alone would hold it. */
static void gs4i_find_pressed(const gs4i_boundary *b, const gs4i_grid *g, gs4_real dt, int wall)
{
    const gs4_real outward = wall & 1 ? GS4I_C(1) : GS4I_C(-1);
    int i;
    for (i = 0; i < b->mirror_count[wall]; i++) {
        const gs4i_mirror_pair *pair = &b->mirrors[wall][i];
        const gs4_real push = gs4i_of_node(g->force, pair->mirror)[wall / 2] * outward * dt,
                       v = gs4i_of_node(gs4i_velocity(g), pair->inner)[wall / 2] * outward,
                       mass = gs4i_of_node(gs4i_velocity(g), pair->mirror)[3];
        if (push > 0 && push > GS4I_C(-0.1) * v * mass) g->flags[pair->mirror] |= GS4I_PRESSED;
    }
}

/* Fold forces of stress, in the order of momentum; what is beside them too, but for the mass of
 * deconvolution. */
static void gs4i_fold_force(const gs4i_boundary *b, const gs4i_grid *g, gs4_real dt)
{
    gs4i_parity parity[6];
    int separating, wall;
    gs4i_vector_parity(b, g->with_deconvolution ? 3 : 4, parity);
    for (separating = 0; separating < 2; separating++) {
        for (wall = 0; wall < 6 && separating; wall++)
            if (b->walls[wall] == GS4_WALL_SEPARATE) gs4i_find_pressed(b, g, dt, wall);
        for (wall = 0; wall < 6; wall++)
            if ((b->walls[wall] == GS4_WALL_SEPARATE) == separating)
                gs4i_fold_wall(b, g, g->force, wall, &parity[wall]);
    }
}

/* Let mirror nodes continue a field of vectors; the mass beside velocities behind periodic walls
 * too, and what is beside accelerations. */
static void gs4i_fill_mirror_nodes(const gs4i_boundary *b, const gs4i_grid *g, gs4_real *field)
{
    gs4i_parity parity[6];
    int wall;
    gs4i_vector_parity(b, 3, parity);
    for (wall = 0; wall < 6; wall++)
        if (field == g->force ? !g->with_deconvolution
                              : field == g->momentum && b->walls[wall] == GS4_WALL_PERIODIC)
            parity[wall].reals = 4;
    gs4i_fill(b, g, field, parity);
}

/* Let mirror nodes have the mass of the nodes inside beside their velocity. */
static void gs4i_fill_mirror_masses(const gs4i_boundary *b, const gs4i_grid *g)
{
    int wall, i;
    for (wall = 5; wall >= 0; wall--)
        for (i = 0; i < b->mirror_count[wall]; i++) {
            const gs4i_mirror_pair *pair = &b->mirrors[wall][i];
            if (gs4i_in_contact(b, g, pair, wall))
                gs4i_of_node(gs4i_velocity(g), pair->mirror)[3] =
                    gs4i_of_node(gs4i_velocity(g), pair->inner)[3];
        }
}

/* Let mirror nodes be as full as the nodes inside. */
static void gs4i_fill_mirror_fractions(const gs4i_boundary *b, const gs4i_grid *g)
{
    int wall, i;
    for (wall = 5; wall >= 0; wall--)
        for (i = 0; i < b->mirror_count[wall]; i++) {
            const gs4i_mirror_pair *pair = &b->mirrors[wall][i];
            if (gs4i_in_contact(b, g, pair, wall))
                g->fill_fraction[pair->mirror] = g->fill_fraction[pair->inner];
        }
}

/* Mirror nodes in contact carry their weight alone: their other forces are folded already. The
 * fourth number of a force is the mass. */
static void gs4i_weigh_mirror_nodes(const gs4i_boundary *b, const gs4i_grid *g, gs4_vec3 gravity)
{
    int wall, i;
    for (wall = 0; wall < 6; wall++)
        for (i = 0; i < b->mirror_count[wall]; i++) {
            const gs4i_mirror_pair *pair = &b->mirrors[wall][i];
            gs4_real *f = gs4i_of_node(g->force, pair->mirror);
            if (!gs4i_in_contact(b, g, pair, wall)) continue;
            f[0] = f[3] * gravity.x;
            f[1] = f[3] * gravity.y;
            f[2] = f[3] * gravity.z;
        }
}

static int gs4i_is_sticky(const gs4i_collider *b)
{
    return b->is.contact == GS4_WALL_STICK && !b->is_emitter && !b->is_off;
}

/* Is a sticky wall, or a sticky body other than `c`, within `reach` (m) of p? */
static int gs4i_sticks_elsewhere(const gs4i_boundary *b, const gs4i_grid *g, const gs4i_collider *c,
                                 gs4_vec3 p, gs4_real reach)
{
    const gs4_real from_low[3] = { p.x - g->origin.x, p.y - g->origin.y, p.z - g->origin.z };
    int i;
    for (i = 0; i < 6; i++) {
        const gs4_real low = from_low[i / 2], size = GS4I_C(g->cells[i / 2]) * g->h;
        if (b->walls[i] == GS4_WALL_STICK && (i & 1 ? size - low : low) < reach) return 1;
    }
    for (i = 0; i < b->collider_count; i++) {
        const gs4i_collider *other = &b->colliders[i];
        if (other != c && gs4i_is_sticky(other) && gs4i_collider_distance(other, p) < reach)
            return 1;
    }
    return 0;
}

/* Does body `c` hold a node at p, which is as far from it as d (m)? Those inside, and a sticky one
 * some before it, but none of these where something else sticks within three cells: in a gap
 * between two bodies that both did so hardly a node would be free, and liquid could not get out of
 * the way of a surface that is steps on the grid (J .76 to 1.2 in a gap of two cells, now .98 to
 * 1.02). */
static int gs4i_holds_node(const gs4i_boundary *b, const gs4i_grid *g, const gs4i_collider *c,
                           gs4_vec3 p, gs4_real d)
{
    if (d < 0 || !gs4i_is_sticky(c)) return d < 0;
    return d < GS4I_STICKY_REACH * g->h
           && !gs4i_sticks_elsewhere(b, g, c, p, GS4I_IMAGE_REACH * g->h);
}

/* What body `b` does to a node at p that it holds and that would go with velocity v and
 * acceleration acc over a step: both become those of the body in the components that contact
 * holds. Returns whether it holds any. */
static int gs4i_collider_hold(const gs4i_collider *b, gs4_vec3 p, gs4_real h,
                              const gs4i_integrator *integrator, gs4_real v[3], gs4_real acc[3])
{
    gs4_vec3 own, n, rel, side;
    gs4_real into, push, slip, bite;
    own = gs4i_collider_velocity(b, p);
    if (b->is.contact == GS4_WALL_STICK) {
        v[0] = own.x;
        v[1] = own.y;
        v[2] = own.z;
        acc[0] = acc[1] = acc[2] = 0;
        return 1;
    }
    n = gs4i_collider_normal(b, p, GS4I_C(0.5) * h);
    rel = gs4i_sub(gs4i_vec3(v[0], v[1], v[2]), own);
    into = -gs4i_dot(rel, n);                             /* > 0: velocity into the body */
    push = -(acc[0] * n.x + acc[1] * n.y + acc[2] * n.z); /* > 0: acceleration into it */
    if (into + integrator->dt * push <= 0) return 0;
    side = gs4i_add(rel, gs4i_scale(n, into)); /* tangential velocity */
    slip = gs4i_length(side);
    if (b->is.friction > 0) {
        gs4_vec3 drag = gs4i_add(gs4i_vec3(acc[0], acc[1], acc[2]), gs4i_scale(n, push));
        /* Coulomb, on the impact */
        bite = gs4i_min(b->is.friction * gs4i_max(into, 0), slip);
        side = gs4i_scale(side, slip > 0 ? (slip - bite) / slip : GS4I_C(0));
        /* and on the steady load: at most what leaves the rate -stopping u along the surface */
        drag = gs4i_add(drag, gs4i_scale(side, integrator->stopping));
        slip = gs4i_length(drag);
        bite = gs4i_min(b->is.friction * gs4i_max(push, 0), slip);
        drag = gs4i_scale(drag, slip > 0 ? bite / slip : GS4I_C(0));
        acc[0] -= drag.x;
        acc[1] -= drag.y;
        acc[2] -= drag.z;
    }
    v[0] = own.x + side.x;
    v[1] = own.y + side.y;
    v[2] = own.z + side.z;
    acc[0] += n.x * push;
    acc[1] += n.y * push;
    acc[2] += n.z * push;
    return 1;
}

/* The emitter that is at x, the last one there; or NULL. */
static const gs4i_collider *gs4i_emitter_at(const gs4i_boundary *b, gs4_vec3 x)
{
    const gs4i_collider *emitter = NULL;
    int i;
    for (i = 0; i < b->collider_count; i++) {
        const gs4i_collider *collider = &b->colliders[i];
        if (collider->is_emitter && !collider->is_off && gs4i_collider_distance(collider, x) < 0)
            emitter = collider;
    }
    return emitter;
}

/* Put a particle that ended inside a body, or behind a closed wall, back on its surface; the
 * part of its velocity that leads further in is lost. In an emitter, as one that is modelled as a
 * solid body, there are no bodies. */
static void gs4i_put_back(const gs4i_boundary *b, const gs4i_grid *g, gs4_real x[3], gs4_real v[3])
{
    int i, a, pass, moved = !gs4i_emitter_at(b, gs4i_vec3(x[0], x[1], x[2]));
    for (pass = 0; pass < 2 && moved; pass++) /* two bodies may meet */
        for (moved = 0, i = 0; i < b->collider_count; i++) {
            const gs4i_collider *collider = &b->colliders[i];
            gs4_vec3 p = gs4i_vec3(x[0], x[1], x[2]), n, rel;
            gs4_real d = collider->is_emitter ? GS4I_C(0) : gs4i_collider_distance(collider, p),
                     into;
            if (!(d < 0)) continue;
            moved = 1;
            d = gs4i_max(d, -2 * g->h); /* no farther than that in a step */
            n = gs4i_collider_normal(collider, p, GS4I_C(0.1) * g->h);
            rel = gs4i_sub(gs4i_vec3(v[0], v[1], v[2]), gs4i_collider_velocity(collider, p));
            into = gs4i_min(gs4i_dot(rel, n), 0);
            x[0] -= d * n.x;
            x[1] -= d * n.y;
            x[2] -= d * n.z;
            v[0] -= into * n.x;
            v[1] -= into * n.y;
            v[2] -= into * n.z;
        }
    for (a = 0; a < 3; a++) {
        gs4_real low = a == 0   ? g->origin.x
                       : a == 1 ? g->origin.y
                                : g->origin.z,
                 size = GS4I_C(g->cells[a]) * g->h;
        gs4_real high = low + size - 4 * GS4I_EPSILON * (gs4i_abs(low) + size);
        if (b->walls[2 * a] == GS4_WALL_PERIODIC) {
            if (x[a] < low) x[a] += size;
            if (x[a] >= low + size) x[a] -= size;
            /* rounding of the shift */
            if (x[a] < low || x[a] > high) x[a] = x[a] < low ? low : high;
            continue;
        }
        if (x[a] < low && b->walls[2 * a] != GS4_WALL_OPEN) {
            x[a] = low;
            if (v[a] < 0) v[a] = 0;
        }
        if (x[a] > high && b->walls[2 * a + 1] != GS4_WALL_OPEN) {
            x[a] = high;
            if (v[a] > 0) v[a] = 0;
        }
    }
}

/* In an emitter a particle goes with the flow: at its velocity, uncompressed, without rates.
 * Returns the emitter, NULL outside of all. */
static const gs4i_collider *gs4i_hold_in_emitter(const gs4i_boundary *b, const gs4_real x[3],
                                                 gs4_real v[4])
{
    const gs4_vec3 p = gs4i_vec3(x[0], x[1], x[2]);
    const gs4i_collider *emitter = gs4i_emitter_at(b, p);
    if (emitter) {
        const gs4_vec3 own = gs4i_collider_velocity(emitter, p);
        v[0] = own.x;
        v[1] = own.y;
        v[2] = own.z;
        v[3] = 1;
    }
    return emitter;
}

/* ==== [[state]] what a simulation is ========================================================== */

/* What an emitter gives flows through its shape in rows. In coordinates of the shape place n is at
 * sum over k of (low_k + (n_k + 1/2) spacing_k) axis_k + (flowed + phase of the row) axis_0, where
 * axis_0 is along the flow. At first 0 <= n_k < places_k. */
typedef struct gs4i_emitter {
    gs4_emitter is;
    int collider; /* that holds the particles in it */
    double axis[3][3], low[3], spacing[3];
    int places[3];
    gs4_real mass;          /* kg of a particle, so that all rows give speed times area */
    double window;          /* m, the least of its extent along the flow and spacing_0 */
    double flowed, emitted; /* m; the same at the last emission, if there was one */
    double active;          /* s of this step in which it is on */
    int has_emitted;
} gs4i_emitter;

/* Heat on nodes: only while a step is made, see [[conduction]]. What heat_nodes hold until the
 * solve: m c (J/K), m c T** (J), V / k_eff (m^4 K/W), V (m^3); and after it: T~ - T** (K), rate of
 * mixing (1/s), that times the temperature to mix to (K/s); in mirror nodes of isothermal walls
 * the rate once more, else 0. What heat_sources hold until the solve: power (W), mixing (W/K); for
 * what they hold after it see gs4i_heat_from_box. */
enum {
    GS4I_NODE_CAPACITY,
    GS4I_NODE_HEAT,
    GS4I_NODE_RESISTANCE,
    GS4I_NODE_VOLUME,
    GS4I_NODE_CHANGE = 0,
    GS4I_NODE_MIXING_RATE,
    GS4I_NODE_MIXING_TARGET,
    GS4I_SOURCE_POWER = 0,
    GS4I_SOURCE_MIXING,
    GS4I_SOURCE_RESISTANCE = 3
};
typedef struct gs4i_conduction {
    gs4_real *heat_nodes, *heat_sources; /* 4 a node; NULL where there is none */
    int slots;
    int with_viscous_heating; /* some material is heated by viscosity */
    gs4i_box box;
    gs4i_elliptic system;       /* its unknown: T~ - T** (K); c = s k fill (J/(m K)) */
    gs4_real *temperature;      /* T**, K */
    gs4_real *conductivity;     /* k_eff, W/(m K) */
    gs4_real *fill_fraction;    /* m^3 of material per m^3 */
    gs4_real *capacity;         /* J/(m^3 K) of space */
    gs4_real *mixing;           /* W/(m^3 K) */
    int surface_is_isothermal;  /* air or a collider is */
    int boundary_is_isothermal; /* they or a wall */
} gs4i_conduction;

typedef struct gs4i_staggered {
    gs4i_box box;
    int from[3], to[3];            /* the domain, in cells of the box */
    int first[3], end[3];          /* what is solved for: without copies behind periodic walls */
    gs4_real *given[3], *taken[3]; /* quads */
    gs4_real *seen[3];             /* v_i */
    gs4_real *force[3], *reach[3]; /* of stress; c of [[poisson]] at faces */
    /* with bodies: open share of a face; velocity and acceleration of what closes the rest */
    gs4_real *open[3], *body[3];
    uint8_t *held[3]; /* faces that a sticky body or an emitter holds */
    uint8_t *known[3];
    uint8_t *contact; /* of a cell, where something separates: a bit for each side; NULL else */
    gs4_real *cell;   /* quads, GS4I_CELL_FILL ... */
    gs4_real *diagonal, *rhs, *pressure;   /* of [[poisson]] */
    int compressible;                      /* some K is finite */
    int is_safe;                           /* no particle needs a trial */
    int is_viscous;                        /* sticky walls take hold of what moves along them */
    int is_plain;                          /* acc is not split, and not remembered */
    int without_split, without_correction; /* for tests of what they are for */
    uint8_t *kind;                         /* gs4_cell */
    gs4i_elliptic system;                  /* the solver; all of it where an axis is periodic */
    gs4i_scratch fitted, fit; /* faces at surfaces; vectors of them, see [[partitioned]] */
    int iterations;           /* of this step */
    double residual;          /* the largest of this step */
} gs4i_staggered;

typedef enum gs4i_clock {
    GS4I_CLOCK_SORT,
    GS4I_CLOCK_SOLVE,
    GS4I_CLOCK_TOTAL,
    GS4I_CLOCKS
} gs4i_clock;

struct gs4_sim {
    gs4_sim_desc desc;
    gs4i_memory memory;
    gs4i_tasks tasks;
    gs4i_grid grid;
    gs4i_particles particles;
    gs4i_boundary boundary;
    gs4i_image_particles image_particles;
    gs4i_conduction conduction;
    gs4i_staggered staggered;
    /* of each material; of its solid phase */
    gs4i_material_constants *constants, *solid_phase;
    int material_count, material_capacity, solid_phase_capacity;
    gs4i_emitter *emitters;
    int emitter_count, emitter_capacity;
    gs4i_report *reports;
    int report_capacity; /* per occupied block */
    gs4i_report limits;  /* extremes of the present state, which set the stable dt */
    gs4i_integrator integrator, heat_integrator; /* of this step; the same for heat */
    double time, last_dt, seconds[GS4I_CLOCKS];
    /* stress integrated robustly, bounded: particles and steps so far */
    uint64_t steps, split, bounded;
    uint32_t next_id;
    gs4_real min_mass, max_mass; /* of any particle so far */
    /* m/s, the greatest that was ever set: chooses a sound speed where none is given */
    gs4_real top_speed;
    gs4_real shift; /* of the rates of positions, left by the last step */
    /* start rates anew; sort before the next step; `limits` are out of date */
    int restart, needs_sort, limits_stale;
    /* stable dt by what the stage of the last step saw; 0: it did not get there */
    gs4_real stage_limit;
    /* particles were edited by hand: check them; velocities too: find the spin of solids */
    int needs_check, needs_spin;
    int bad_distance; /* see gs4i_shape_or_field */
    unsigned warned;  /* gs4i_warning */
    int busy;         /* a callback may be running: no call may change anything */
    int asks;         /* a callback of viscosity may be, for gs4_stable_dt */
    gs4_sim *self;    /* its error is noted by gs4_stable_dt too, to which it is const */
    double time_left; /* s, of gs4_advance */
    gs4i_error error; /* the last one */
};

static double gs4i_now(gs4_sim *sim)
{
    const int busy = sim->busy;
    double now;
    if (!sim->desc.now) return 0;
    sim->busy = 1;
    now = sim->desc.now(sim->desc.now_user);
    sim->busy = busy;
    return now;
}

static double gs4i_since(gs4_sim *sim, double start) { return gs4i_elapsed(start, gs4i_now(sim)); }

/* What is likely not meant, though it is allowed: said once a simulation, at level 1. */
typedef enum gs4i_warning {
    GS4I_WARN_CUT_OFF = 1,
    GS4I_WARN_INSIDE_BODY = 2,
    GS4I_WARN_EMITTER_IN_BODY = 4,
    GS4I_WARN_THIN_EMITTER = 8,
    GS4I_WARN_STILL_EMITTER = 16,
    GS4I_WARN_SHORT_STEPS = 32,
    GS4I_WARN_COLD = 64,
    GS4I_WARN_SUBSTEPS = 128,
    GS4I_WARN_DISTANCE = 256,
    GS4I_WARN_FULL = 512,
    GS4I_WARN_EMITTER_OUTSIDE = 1024,
    GS4I_WARN_SOFT = 2048
} gs4i_warning;

static int gs4i_will_warn(const gs4_sim *sim, gs4i_warning which)
{
    return sim->desc.log && !(sim->warned & (unsigned)which);
}

/* "<before><value><after>" */
static void gs4i_warn_value(gs4_sim *sim, gs4i_warning which, const char *before, double value,
                            const char *after)
{
    char line[320];
    gs4i_text t = gs4i_text_into(line, sizeof line);
    if (!gs4i_will_warn(sim, which)) return;
    sim->warned |= (unsigned)which;
    gs4i_put(&t, before);
    gs4i_put_real(&t, value);
    gs4i_put(&t, after);
    gs4i_log(&sim->error, 1, line);
}

static void gs4i_warn(gs4_sim *sim, gs4i_warning which, const char *line)
{
    if (!gs4i_will_warn(sim, which)) return;
    sim->warned |= (unsigned)which;
    gs4i_log(&sim->error, 1, line);
}

/* The law of a particle in its phase. */
GS4I_INLINE const gs4i_material_constants *gs4i_constants_of(const gs4_sim *sim, size_t i)
{
    const gs4i_particles *p = &sim->particles;
    return p->liquid && !p->liquid[i] ? &sim->solid_phase[p->material[i]]
                                      : &sim->constants[p->material[i]];
}

/* --- passes over nodes ------------------------------------------------------------------------ */

enum {
    GS4I_GROUP = 16
}; /* blocks a task */

typedef struct gs4i_node_pass {
    gs4_sim *sim;
    /* nodes with less mass are empty: what they hold is below rounding */
    gs4_real lightest;
} gs4i_node_pass;

GS4I_INLINE int gs4i_group_end(const gs4i_grid *g, int index)
{
    return (index + 1) * GS4I_GROUP < g->active ? (index + 1) * GS4I_GROUP : g->active;
}

static int gs4i_groups(const gs4_sim *sim)
{
    return (sim->grid.active + GS4I_GROUP - 1) / GS4I_GROUP;
}

/* ==== [[transfer]] particles to nodes and back ================================================= *
 *
 * What all kernels share. A kernel does one occupied block, batch after batch: load, predict,
 * weights; then 27 nodes a particle, one particle after another; what particles do by themselves
 * in between goes in lanes. Kernels that scatter run colour by colour, so that no two tiles in
 * work share a node; sums within a block run in the order of its particles. */

typedef struct gs4i_pass {
    gs4_sim *sim;
    const int32_t *blocks;
    int count;
    int commit; /* of S7; 0: a trial, which writes nothing to particles */
} gs4i_pass;

/* S2: a batch and its weights at the predicted positions. */
GS4I_INLINE void gs4i_stage_batch(const gs4i_particles *p, size_t i, int n,
                                  gs4i_prediction prediction, const gs4i_frame *f, gs4i_batch *q,
                                  gs4i_stencils *s)
{
    gs4i_lanes x[3];
    gs4i_load_batch(p, i, n, prediction, q);
    gs4i_predict_positions(q, prediction, x);
    gs4i_stencils_at(s, f, x);
}

/* Run a scattering kernel over blocks, colour after colour. */
static void gs4i_scatter_by_colour(gs4_sim *sim, const int32_t *blocks, const int first[9],
                                   gs4_task_fn kernel)
{
    gs4i_pass pass;
    int colour;
    pass.sim = sim;
    pass.commit = 1;
    for (colour = 0; colour < 8; colour++) {
        pass.blocks = blocks + first[colour];
        pass.count = first[colour + 1] - first[colour];
        gs4i_parallel_for(&sim->tasks, pass.count, kernel, &pass);
    }
}

/* Run a scattering kernel over all occupied blocks. */
static void gs4i_scatter(gs4_sim *sim, gs4_task_fn kernel)
{
    gs4i_scatter_by_colour(sim, sim->grid.by_colour, sim->grid.colour_first, kernel);
}

/* Run a gathering kernel over all occupied blocks. */
static void gs4i_gather(gs4_sim *sim, gs4_task_fn kernel, int commit)
{
    gs4i_pass pass;
    pass.sim = sim;
    pass.blocks = sim->grid.by_colour;
    pass.count = sim->grid.occupied;
    pass.commit = commit;
    gs4i_parallel_for(&sim->tasks, pass.count, kernel, &pass);
}

/* Extremes over all blocks of the last pass. */
static gs4i_report gs4i_all_reports(const gs4_sim *sim)
{
    gs4i_report all;
    int o;
    gs4i_report_clear(&all);
    for (o = 0; o < sim->grid.occupied; o++) gs4i_report_merge(&all, &sim->reports[o]);
    return all;
}

/* The batch that begins at particle i of a block that ends at `end`. */
GS4I_INLINE int gs4i_batch_size(size_t i, size_t end)
{
    return end - i < GS4I_BATCH ? (int)(end - i) : GS4I_BATCH;
}

/* The block that is next after task `index` of a pass, for prefetching. */
GS4I_INLINE int gs4i_next_block(const gs4i_pass *pass, int index)
{
    return pass->blocks[index + 1 < pass->count ? index + 1 : index];
}

/* --- scattering ------------------------------------------------------------------------------- */

/* tile += w_ij q, for particle n of a batch */
GS4I_INLINE void gs4i_scatter_quad(gs4_real *tile, const gs4i_stencils *s, int n,
                                   const gs4_real *from)
{
    gs4i_row w, p, r, t;
    gs4i_quad q;
    int j, k;
    GS4I_LOAD(q, from);
    gs4i_row_of_nodes(&w, GS4I_NTH_CONST(s->w[0][0], n), GS4I_NTH_CONST(s->w[0][1], n),
                      GS4I_NTH_CONST(s->w[0][2], n));
    gs4i_row_of_quad(&p, &q);
    GS4I_ROW_MUL(p, w, p);
    for (k = 0; k < 3; k++) {
        GS4I_ROW_SPLAT_MUL(t, GS4I_NTH_CONST(s->w[2][k], n), p);
        for (j = 0; j < 3; j++) {
            gs4_real *row = tile + 4 * (s->base[n] + GS4I_TILE * (GS4I_TILE * k + j));
            GS4I_ROW_LOAD(r, row);
            GS4I_ROW_SPLAT_MAD(r, GS4I_NTH_CONST(s->w[1][j], n), t);
            GS4I_ROW_STORE(row, r);
        }
    }
}

/* Momentum of a batch on its way to the nodes: m v at the node in the middle, and what changes
 * by one node along each axis. */
typedef struct gs4i_affine_forces {
    gs4_real middle[4 * GS4I_BATCH], x[4 * GS4I_BATCH], y[4 * GS4I_BATCH], z[4 * GS4I_BATCH];
} gs4i_affine_forces;

/* tile += w_ij (B + (i - 1) Qx + (j - 1) Qy + (k - 1) Qz), for particle n of a batch */
GS4I_INLINE void gs4i_scatter_affine(gs4_real *tile, const gs4i_stencils *s, int n,
                                     const gs4i_affine_forces *f)
{
    gs4i_row w, wx, v, p0, p1, p2, side[3], r, t;
    gs4i_quad q;
    int j, k;
    gs4i_row_of_nodes(&w, GS4I_NTH_CONST(s->w[0][0], n), GS4I_NTH_CONST(s->w[0][1], n),
                      GS4I_NTH_CONST(s->w[0][2], n));
    gs4i_row_of_nodes(&wx, -GS4I_NTH_CONST(s->w[0][0], n), 0, GS4I_NTH_CONST(s->w[0][2], n));
    GS4I_LOAD(q, f->middle + 4 * n);
    gs4i_row_of_quad(&v, &q);
    GS4I_ROW_MUL(p0, w, v);
    GS4I_LOAD(q, f->x + 4 * n);
    gs4i_row_of_quad(&v, &q);
    GS4I_ROW_MAD(p0, wx, v);
    GS4I_LOAD(q, f->y + 4 * n);
    gs4i_row_of_quad(&v, &q);
    GS4I_ROW_MUL(p1, w, v);
    GS4I_LOAD(q, f->z + 4 * n);
    gs4i_row_of_quad(&v, &q);
    GS4I_ROW_MUL(p2, w, v);
    for (j = 0; j < 3; j++) {
        if (j == 0)
            GS4I_ROW_DIFFERENCE(side[1], p0, p1);
        else if (j == 1)
            side[1] = p0;
        else
            GS4I_ROW_SUM(side[1], p0, p1);
        GS4I_ROW_SPLAT_MUL(side[1], GS4I_NTH_CONST(s->w[1][j], n), side[1]);
        GS4I_ROW_SPLAT_MUL(t, GS4I_NTH_CONST(s->w[1][j], n), p2);
        GS4I_ROW_DIFFERENCE(side[0], side[1], t);
        GS4I_ROW_SUM(side[2], side[1], t);
        for (k = 0; k < 3; k++) {
            gs4_real *row = tile + 4 * (s->base[n] + GS4I_TILE * (GS4I_TILE * k + j));
            GS4I_ROW_LOAD(r, row);
            GS4I_ROW_SPLAT_MAD(r, GS4I_NTH_CONST(s->w[2][k], n), side[k]);
            GS4I_ROW_STORE(row, r);
        }
    }
}

/* |C| dt is bounded by 1/4: the factor that makes it so. */
GS4I_INLINE void gs4i_affine_bound(gs4i_gradient C, gs4_real dt, gs4i_lanes bound)
{
    const gs4_real limit = GS4I_C(0.0625) / (dt * dt);
    gs4i_lanes squared;
    int b, good = 1;
    gs4i_gradient_squared(C, squared);
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide_mask fine = squared[b] <= limit;
        good &= gs4i_all(&fine);
        bound[b] = (squared[b] - squared[b]) + GS4I_C(1);
    }
    for (b = 0; b < GS4I_BATCH && !good; b++)
        if (GS4I_NTH(squared, b) > limit)
            GS4I_NTH(bound, b) = GS4I_SQRT(limit / GS4I_NTH(squared, b));
}

/* tile += (-V sigma) grad w + w m g, for particle n of a batch */
GS4I_INLINE void gs4i_scatter_force(gs4_real *tile, const gs4i_stencils *s, int n,
                                    const gs4i_forces *f)
{
    gs4i_row p0, p1, p2, r, w, d;
    gs4i_quad q;
    gs4i_x_weights(s, n, &w, &d);
    GS4I_LOAD(q, f->x + 4 * n);
    gs4i_row_of_quad(&r, &q);
    GS4I_ROW_MUL(p0, d, r);
    GS4I_LOAD(q, f->weight + 4 * n);
    gs4i_row_of_quad(&r, &q);
    GS4I_ROW_MAD(p0, w, r);
    GS4I_LOAD(q, f->y + 4 * n);
    gs4i_row_of_quad(&r, &q);
    GS4I_ROW_MUL(p1, w, r);
    GS4I_LOAD(q, f->z + 4 * n);
    gs4i_row_of_quad(&r, &q);
    GS4I_ROW_MUL(p2, w, r);
    gs4i_scatter_rows(tile + 4 * s->base[n], &p0, &p1, &p2, s, n);
}

/* --- gathering -------------------------------------------------------------------------------- */

/* The jumps around occupied block o; the fourth number is 1 in mirror nodes in contact and
 * in nodes in or held by sticky colliders, else 0.
 * Returns 0, and nothing, where there are none. */
static int gs4i_load_jumps(const gs4i_grid *g, int o, uint64_t rows, gs4_real *tile)
{
    static const int from[3] = { 8, 0, 0 }, to[3] = { 0, 8, 24 }, count[3] = { 8, 16, 8 };
    int i, row;
    if (!gs4i_jumps_are_near(g, o)) return 0;
    memset(tile, 0, GS4I_TILE_REALS * sizeof *tile);
    for (row = 0; row < GS4I_TILE * GS4I_TILE; row++, tile += 4 * GS4I_TILE) {
        ptrdiff_t at[3];
        if (!(rows >> row & 1)) continue;
        gs4i_tile_row(g, o, row & 7, row >> 3, at);
        for (i = 0; i < 3; i++) {
            const uint32_t node = (uint32_t)(at[i] / 4);
            if (gs4i_has_jumps(g, gs4i_slot_of(node)))
                memcpy(tile + to[i], gs4i_jump_of_node(g, node) + from[i],
                       (size_t)count[i] * sizeof *tile);
        }
    }
    return 1;
}

/* What nodes give to particle n beside velocity; a batch with solids wants its gradient too. */
GS4I_INLINE void gs4i_gather_rate(int solids, const gs4_real *at, const gs4i_stencils *s, int n,
                                  const gs4i_row *w, const gs4i_row *d, gs4i_gathered *g)
{
    if (solids)
        gs4i_gather_local(at, s, n, w, d, g);
    else
        gs4i_gather_value(at, s, n, w, g->value);
}

static void gs4i_load_gathered_rates(const gs4i_gathered *acc, const gs4i_gathered *jump, int n,
                                     gs4i_gathered_rates *rates)
{
    gs4i_gradient_lanes(acc->dx, acc->dy, acc->dz, n, rates->acc);
    if (jump)
        gs4i_gradient_lanes(jump->dx, jump->dy, jump->dz, n, rates->jump);
    else
        memset(rates->jump, 0, sizeof rates->jump);
}

/* --- heat ------------------------------------------------------------------------------------- */

/* What a kernel needs on top in a scene with heat, on the stack of such scenes alone; kernels get
 * NULL in others. One tile has what goes to the nodes or comes from them, the other the sources,
 * or what gives gradients for the flux: as in gs4i_conduction. */
typedef struct gs4i_heat_pass {
    gs4i_heat_work work;
    gs4_real nodes[GS4I_TILE_REALS], sources[GS4I_TILE_REALS];
} gs4i_heat_pass;

static void gs4i_clear_heat_tiles(gs4i_heat_pass *h)
{
    memset(h->nodes, 0, sizeof h->nodes);
    memset(h->sources, 0, sizeof h->sources);
}

/* What the particles of a batch give to the tiles of heat. */
GS4I_INLINE void gs4i_scatter_heat(const gs4_sim *sim, gs4i_heat_pass *heat, const gs4i_stencils *s,
                                   int n)
{
    const gs4i_heat_given *given = &heat->work.given;
    int b;
    for (b = 0; b < n; b++)
        if (s->base[b] >= 0) {
            gs4i_scatter_quad(heat->nodes, s, b, given->nodes + 4 * b);
            if (!sim->conduction.heat_sources) continue;
            if (sim->particles.with_flux)
                gs4i_scatter_force(heat->sources, s, b, &given->sources);
            else
                gs4i_scatter_quad(heat->sources, s, b, given->sources.weight + 4 * b);
        }
}

static void gs4i_add_heat(const gs4_sim *sim, int o, const gs4i_heat_pass *w)
{
    gs4i_tile_add(&sim->grid, o, sim->reports[o].rows, w->nodes, sim->conduction.heat_nodes);
    if (sim->conduction.heat_sources)
        gs4i_tile_add(&sim->grid, o, sim->reports[o].rows, w->sources,
                      sim->conduction.heat_sources);
}

static void gs4i_load_heat_tiles(const gs4_sim *sim, int o, gs4i_heat_pass *h)
{
    gs4i_tile_load(&sim->grid, o, sim->reports[o].rows, sim->conduction.heat_nodes, h->nodes);
    if (sim->particles.with_flux)
        gs4i_tile_load(&sim->grid, o, sim->reports[o].rows, sim->conduction.heat_sources,
                       h->sources);
}

/* S7 of heat for a batch, whose constants are there. */
static void gs4i_gather_heat(const gs4i_response *r, const gs4i_stencils *s, gs4i_gradient L,
                             gs4i_heat_pass *heat)
{
    const gs4i_particles *p = r->p;
    gs4i_heat_work *w = &heat->work;
    gs4i_gathered g;
    gs4i_lanes value[4], slope[4], column[4];
    gs4_real change[4 * GS4I_BATCH];
    int b;
    gs4i_load_heat(p, r->i, r->n, &w->h);
    gs4i_load_heat_constants(&r->constants, &w->constants);
    memset(slope, 0, sizeof slope);
    for (b = 0; b < r->n; b++) {
        gs4i_row x, d;
        gs4i_x_weights(s, b, &x, &d);
        gs4i_gather_value(heat->nodes + 4 * s->base[b], s, b, &x, change);
        if (p->with_flux) gs4i_gather_local(heat->sources + 4 * s->base[b], s, b, &x, &d, &g);
    }
    gs4i_to_lanes(change, r->n, value);
    if (p->with_flux) {
        gs4i_to_lanes(g.dx, r->n, column);
        memcpy(slope[0], column[0], sizeof slope[0]);
        gs4i_to_lanes(g.dy, r->n, column);
        memcpy(slope[1], column[1], sizeof slope[1]);
        gs4i_to_lanes(g.dz, r->n, column);
        memcpy(slope[2], column[2], sizeof slope[2]);
        gs4i_to_lanes(g.value, r->n, column);
        memcpy(slope[3], column[3], sizeof slope[3]);
    }
    gs4i_correct_enthalpy(w, value);
    if (p->with_flux) gs4i_correct_flux(w, slope, L);
    gs4i_store_heat(p, r->i, r->n, &w->h);
    /* hysteresis: in between the phase stays */
    for (b = 0; b < r->n && w->constants.melts; b++)
        if (GS4I_NTH(w->h.fraction, b) >= 1 || GS4I_NTH(w->h.fraction, b) <= 0)
            gs4i_set_phase(p, r->i + (size_t)b, GS4I_NTH(w->h.fraction, b) > 0);
}

/* |div u| dt up to which J is known to stay in its range: it changes by less than a quarter. */
#define GS4I_SAFE_STRAIN 0.2

/* --- responses of a block --------------------------------------------------------------------- */

/* Ask the laws about particles of `p`; `heat` NULL: the scene has none. */
static void gs4i_begin_response(gs4i_response *r, const gs4_sim *sim, const gs4i_particles *p,
                                const gs4i_integrator *integrator, gs4i_report *report,
                                gs4i_heat_pass *heat)
{
    memset(r, 0, sizeof *r);
    r->p = p;
    r->integrator = integrator;
    r->materials = sim->constants;
    r->solid_phase = sim->solid_phase;
    r->report = report;
    gs4i_see_nothing(&r->seen);
    if (!heat) return;
    memset(&heat->work.constants, 0, sizeof heat->work.constants);
    heat->work.integrator = &sim->heat_integrator;
    heat->work.with_flux = p->with_flux;
    heat->work.ahead = sim->heat_integrator.prediction.ahead;
    r->heat = &heat->work;
}

/* ==== [[sticky]] image particles behind sticky colliders ======================================= *
 *
 * Particles within three cells of the surface of a sticky collider have an image behind it,
 * x' = x - 2 d n. It gives the nodes what a field odd about the surface needs: momentum
 * m (2 v_collider - v), stress -sigma R and weight -m g, with R = I - 2 n n. Near the surface
 * particles see the odd part of what the nodes have, u = v_collider + (u(x) - u(x'))/2, and its
 * gradient. So a collider is a wall of second order wherever its surface lies, as far as particles
 * fill the space before it. Where it is too thin or too crooked for images, nodes are held:
 * gs4i_collider_hold. */

/* What becomes of a particle near a sticky collider that has no image: nothing, or held nodes. */
enum {
    GS4I_NO_IMAGE = -1,
    GS4I_HOLDS_NODES = -2
};

/* What is scattered. */
enum {
    GS4I_IMAGE_MOMENTUM,
    GS4I_IMAGE_AFFINE,
    GS4I_IMAGE_FORCE
};

/* --- surfaces: how far particles are from them ------------------------------------------------- *
 *
 * Distance functions may be slow, so each is asked once a node near it instead of several times a
 * particle: once a step, of bodies at rest once as long as blocks stay. Particles take from nodes,
 * to third order in h. Where a body is flat it is known without. */

/* cells: half the diagonal of a block, and a cell that particles may be outside of it */
#define GS4I_BLOCK_REACH GS4I_C(5.2)
/* cells: half the diagonal of the nodes of a block; how far nodes are that a particle sees */
#define GS4I_NODES_REACH GS4I_C(2.6)
/* how far a body may bend from a half space under an image, in cells */
#define GS4I_IMAGE_BEND GS4I_C(0.25)

enum {
    GS4I_SURFACE_FAR,
    GS4I_SURFACE_FLAT,
    GS4I_SURFACE_CURVED
};

/* What a block has of the surface of a body: particles in it may have images by it, or none. */
static gs4i_surface gs4i_find_surface(const gs4i_grid *g, const gs4i_collider *b, uint32_t block)
{
    const gs4_real reach = GS4I_BLOCK_REACH * g->h;
    gs4i_surface f;
    memset(&f, 0, sizeof f);
    f.at = gs4i_block_centre(g, block);
    f.d = gs4i_collider_distance(b, f.at);
    f.kind = GS4I_SURFACE_FAR;
    if (f.d < reach + GS4I_IMAGE_REACH * g->h)
        f.kind = gs4i_collider_is_flat(b, f.at, reach, GS4I_IMAGE_NODES * g->h, &f.n)
                     ? GS4I_SURFACE_FLAT
                     : GS4I_SURFACE_CURVED;
    return f;
}

/* The same of occupied block o, once it is found. */
GS4I_INLINE const gs4i_surface *gs4i_surface_of(const gs4_sim *sim, int collider, int o)
{
    return (const gs4i_surface *)sim->image_particles.patches.surfaces.data
           + (size_t)collider * (size_t)sim->grid.occupied + (size_t)o;
}

/* Number of the patch of a body in a slot, or -1. */
GS4I_INLINE int gs4i_patch_of(const gs4_sim *sim, int collider, int slot)
{
    const gs4i_patches *p = &sim->image_particles.patches;
    return ((const int32_t *)p->of.data)[(size_t)collider * (size_t)p->active + (size_t)slot] - 1;
}

/* Distance of node i of a slot, at p, from a body. */
static gs4_real gs4i_node_distance(const gs4_sim *sim, int collider, int slot, int i, gs4_vec3 p)
{
    const gs4i_patches *patches = &sim->image_particles.patches;
    const int patch = patches->count ? gs4i_patch_of(sim, collider, slot) : -1;
    return patch < 0 ? gs4i_collider_distance(&sim->boundary.colliders[collider], p)
                     : ((const gs4_real *)
                            patches->distance.data)[(size_t)patch * GS4I_BLOCK_NODES + (size_t)i];
}

/* Distance of a node of the tile of occupied block o from a body that is curved there. */
GS4I_INLINE gs4_real gs4i_tile_distance(const gs4_sim *sim, int collider, int o, int node)
{
    const gs4i_patches *patches = &sim->image_particles.patches;
    const int x = node % GS4I_TILE + 2, y = node / GS4I_TILE % GS4I_TILE + 2,
              z = node / (GS4I_TILE * GS4I_TILE) + 2,
              slot = sim->grid.neighbour[27 * o + ((z >> 2) * 3 + (y >> 2)) * 3 + (x >> 2)],
              patch = gs4i_patch_of(sim, collider, slot);
    const gs4_real *d = (const gs4_real *)patches->distance.data;
    return patch < 0 ? GS4I_HUGE : d[patch * GS4I_BLOCK_NODES + gs4i_place_of(x, y, z)];
}

static void gs4i_sample_distances(int index, void *context)
{
    const gs4_sim *sim = (const gs4_sim *)((const gs4i_pass *)context)->sim;
    const gs4i_patches *patches = &sim->image_particles.patches;
    const int number = ((const gs4i_pass *)context)->count + index;
    const gs4i_patch *patch = (const gs4i_patch *)patches->all.data + number;
    gs4_real *d = (gs4_real *)patches->distance.data + (size_t)number * GS4I_BLOCK_NODES;
    int first[3], x[3], i;
    gs4i_block_origin(&sim->grid, sim->grid.block[patch->slot], first);
    for (i = 0; i < GS4I_BLOCK_NODES; i++) {
        gs4i_node_coordinates(first, i, x);
        d[i] = gs4i_collider_distance(&sim->boundary.colliders[patch->collider],
                                      gs4i_place_position(&sim->grid, x, GS4I_AT_CELL));
    }
}

/* Distances of the nodes of a patch and of one more to each side, 6^3; where there is none it goes
 * on as a line. Edges and corners are left out. */
static void gs4i_load_distances(const gs4_sim *sim, const gs4i_patch *patch, gs4_real d[216])
{
    /* of nodes next to each other along an axis: there, and in a block */
    static const int apart[3] = { 1, 6, 36 }, places[3] = { 1, 4, 16 };
    const gs4_real *all = (const gs4_real *)sim->image_particles.patches.distance.data, *from;
    gs4i_surroundings t;
    int i, j, side;
    gs4i_surroundings_of(&sim->grid, patch->slot, &t);
    from = all + (ptrdiff_t)gs4i_patch_of(sim, patch->collider, patch->slot) * GS4I_BLOCK_NODES;
    for (i = 0; i < 16; i++)
        memcpy(d + 43 + 6 * (i & 3) + 36 * (i >> 2), from + 4 * i, 4 * sizeof *d);
    for (side = 0; side < 6; side++) {
        static const int beside[6] = { 12, 14, 10, 16, 4, 22 };
        const int axis = side / 2, u = (axis + 1) % 3, v = (axis + 2) % 3,
                  outwards = side & 1 ? apart[axis] : -apart[axis], slot = t.slot[beside[side]],
                  number = slot < 0 ? -1 : gs4i_patch_of(sim, patch->collider, slot),
                  edge = 43 + (side & 1 ? 3 * apart[axis] : 0),
                  place = side & 1 ? 0 : 3 * places[axis];
        for (i = 0; i < 4; i++)
            for (j = 0; j < 4; j++) {
                gs4_real *at = d + edge + i * apart[u] + j * apart[v];
                at[outwards] = number < 0 ? 2 * *at - at[-outwards]
                                          : all[(ptrdiff_t)number * GS4I_BLOCK_NODES + place
                                                + i * places[u] + j * places[v]];
            }
    }
}

/* Is a particle outside of a body, said by the node nearest to it, which is d from the body, and
 * `away` from the particle in cells? A distance that grows by the way alone would be known by that;
 * half as much again (chosen) forgives functions that are no true distances. */
GS4I_INLINE int gs4i_is_outside(gs4_real d, gs4_real away2, gs4_real h)
{
    const gs4_real sure = GS4I_C(1.5) * h;
    d -= GS4I_C(0.01) * h;
    return d > 0 && d * d > sure * sure * away2;
}

/* Does it say so of every particle that it is nearest to? Half the diagonal of a cell is the most
 * that they are away. */
GS4I_INLINE int gs4i_is_clear(gs4_real d, gs4_real h)
{
    return gs4i_is_outside(d, GS4I_C(0.75), h);
}

/* The rate, 1/s, at which sub-grid velocity decays at p, d from a sticky body: c0/h, or 500 |v|/h
 * (chosen) where that is less, v the body's velocity, within a cell of it, less up to three.
 * A body that moves makes noise as it crosses nodes, by pressure, that is at c0: particles went at
 * up to 1.7 of its speed, now 1.17. None at bodies at rest: where the layer at a wall is thinner
 * than a cell this would mix it (in a pipe energy of a spin fell to .38, not to .51). */
static gs4_real gs4i_near_decay(const gs4_sim *sim, const gs4i_collider *b, gs4_vec3 p, gs4_real d)
{
    const gs4_real inv_h = sim->grid.inv_h,
                   speed = GS4I_C(500) * gs4i_length(gs4i_collider_velocity(b, p)) * inv_h,
                   near = gs4i_max(gs4i_min((GS4I_IMAGE_REACH - d * inv_h) * GS4I_C(0.5), 1), 0);
    return near * gs4i_min(speed, sim->integrator.fast_decay);
}

/* Four numbers of each node of a patch. Its distance d, such that sum w d is that of particles:
 * less a share of its second differences, as sum w d is d + h^2 lap d/8 else. How far the point as
 * deep behind the surface as images matter is from being as deep in the body. lap d (1/m), the
 * curvature. The rate of gs4i_near_decay. */
static void gs4i_sample_patch(int index, void *context)
{
    const gs4_sim *sim = ((const gs4i_pass *)context)->sim;
    const gs4i_patches *patches = &sim->image_particles.patches;
    const int number = ((const gs4i_pass *)context)->count + index;
    gs4i_patch *patch = (gs4i_patch *)patches->all.data + number;
    const gs4i_collider *b = &sim->boundary.colliders[patch->collider];
    const gs4_real h = sim->grid.h, deep = GS4I_IMAGE_NODES * h;
    gs4_real d[216], *to = gs4i_of_slot((gs4_real *)patches->nodes.data, number);
    int first[3], x[3], i;
    gs4i_load_distances(sim, patch, d);
    gs4i_block_origin(&sim->grid, sim->grid.block[patch->slot], first);
    for (i = 0; i < GS4I_BLOCK_NODES; i++) {
        const gs4_real *at = d + 43 + (i & 3) + 6 * (i >> 2 & 3) + 36 * (i >> 4);
        const gs4_vec3 g = gs4i_vec3(at[1] - at[-1], at[6] - at[-6], at[36] - at[-36]);
        const gs4_real length = gs4i_length(g),
                       lap = at[1] + at[-1] + at[6] + at[-6] + at[36] + at[-36] - 6 * *at;
        gs4_vec3 p, n;
        to[4 * i] = *at - lap * GS4I_C(0.125);
        to[4 * i + 1] = h;
        to[4 * i + 2] = lap * sim->grid.inv_h * sim->grid.inv_h;
        gs4i_node_coordinates(first, i, x);
        p = gs4i_place_position(&sim->grid, x, GS4I_AT_CELL);
        to[4 * i + 3] = gs4i_near_decay(sim, b, p, *at);
        /* what particles see that may have images */
        if (!(*at > -2 * GS4I_NODES_REACH * h && *at < (GS4I_IMAGE_REACH + GS4I_NODES_REACH) * h
              && length > 0))
            continue;
        n = gs4i_scale(g, 1 / length);
        to[4 * i + 1] = gs4i_collider_distance(b, gs4i_sub(p, gs4i_scale(n, *at + deep))) + deep;
    }
    patch->nearest = GS4I_HUGE;
    patch->bend[0] = h;
    patch->bend[1] = -h;
    patch->clear = 0;
    for (i = 0; i < GS4I_BLOCK_NODES; i++) {
        const gs4_real own = d[43 + (i & 3) + 6 * (i >> 2 & 3) + 36 * (i >> 4)];
        patch->clear |= (uint64_t)gs4i_is_clear(own, h) << i;
        patch->nearest = gs4i_min(patch->nearest, gs4i_min(own, to[4 * i]));
        patch->bend[0] = gs4i_min(patch->bend[0], to[4 * i + 1]);
        patch->bend[1] = gs4i_max(patch->bend[1], to[4 * i + 1]);
    }
}

/* Do the patches of bodies at rest hold: of the same bodies, in the same blocks? */
static int gs4i_patches_hold(const gs4_sim *sim)
{
    const gs4i_patches *p = &sim->image_particles.patches;
    const gs4i_grid *g = &sim->grid;
    const gs4i_collider *before = (const gs4i_collider *)p->colliders.data;
    const uint32_t *blocks = (const uint32_t *)p->blocks.data;
    int i;
    if (p->collider_count != sim->boundary.collider_count || p->active != g->active
        || p->occupied != g->occupied
        || memcmp(blocks, g->block, (size_t)g->active * sizeof *blocks) != 0
        || memcmp(blocks + g->active, g->occupied_block, (size_t)g->occupied * sizeof *blocks) != 0)
        return 0;
    for (i = 0; i < p->collider_count; i++, before++) {
        const gs4i_collider *now = &sim->boundary.colliders[i];
        if (gs4i_is_sticky(now) != gs4i_is_sticky(before)
            || gs4i_is_moving(now) != gs4i_is_moving(before)
            || (!gs4i_is_moving(now) && memcmp(now, before, sizeof *now) != 0))
            return 0;
    }
    return 1;
}

/* And remember for which they do. */
static int gs4i_keep_patches(gs4_sim *sim)
{
    gs4i_patches *p = &sim->image_particles.patches;
    const gs4i_grid *g = &sim->grid;
    const size_t colliders = (size_t)sim->boundary.collider_count * sizeof *sim->boundary.colliders;
    uint32_t *blocks = (uint32_t *)gs4i_scratch_reserve(
        &sim->memory, &p->blocks, (size_t)(g->active + g->occupied) * sizeof *blocks, 0);
    if (!blocks || !gs4i_scratch_reserve(&sim->memory, &p->colliders, colliders, 0))
        return gs4i_fail_memory(&sim->error);
    memcpy(blocks, g->block, (size_t)g->active * sizeof *blocks);
    memcpy(blocks + g->active, g->occupied_block, (size_t)g->occupied * sizeof *blocks);
    memcpy(p->colliders.data, sim->boundary.colliders, colliders);
    p->occupied = g->occupied;
    p->collider_count = sim->boundary.collider_count;
    return GS4_OK;
}

/* Find a body's surfaces, and list its patches: around blocks that are near it, where it is not
 * flat. */
static int gs4i_list_patches(gs4_sim *sim, int collider)
{
    gs4i_patches *p = &sim->image_particles.patches;
    const gs4i_grid *g = &sim->grid;
    const gs4i_collider *b = &sim->boundary.colliders[collider];
    int32_t *of = (int32_t *)p->of.data + (size_t)collider * (size_t)g->active;
    gs4i_patch *all = (gs4i_patch *)gs4i_scratch_reserve(
        &sim->memory, &p->all, (size_t)(p->count + g->active) * sizeof *all,
        (size_t)p->count * sizeof *all);
    gs4i_surface *surface =
        (gs4i_surface *)p->surfaces.data + (size_t)collider * (size_t)g->occupied;
    int o, i;
    if (!all) return gs4i_fail_memory(&sim->error);
    memset(of, 0, (size_t)g->active * sizeof *of);
    for (o = 0; o < g->occupied; o++, surface++) {
        *surface = gs4i_find_surface(g, b, g->occupied_block[o]);
        if (surface->kind != GS4I_SURFACE_CURVED) continue;
        for (i = 0; i < 27; i++) {
            const int slot = g->neighbour[27 * o + i];
            if (of[slot]) continue;
            of[slot] = -1; /* none of its nodes is seen */
            if (gs4i_find_surface(g, b, g->block[slot]).kind == GS4I_SURFACE_FAR) continue;
            all[p->count].collider = collider;
            all[p->count].slot = slot;
            of[slot] = ++p->count;
        }
    }
    return GS4_OK;
}

/* What the nodes that particles of its blocks see say of a body: how near it comes, and whether
 * particles may have images by it. */
static void gs4i_finish_surfaces(gs4_sim *sim, int collider)
{
    const gs4i_grid *g = &sim->grid;
    const gs4i_patch *all = (const gs4i_patch *)sim->image_particles.patches.all.data;
    const gs4_real h = g->h;
    gs4i_surface *surface = (gs4i_surface *)sim->image_particles.patches.surfaces.data
                            + (size_t)collider * (size_t)g->occupied;
    int o, i;
    for (o = 0; o < g->occupied; o++, surface++) {
        gs4_real bend[2] = { h, -h };
        surface->nearest = surface->kind == GS4I_SURFACE_FLAT ? surface->d - GS4I_BLOCK_REACH * h
                                                              : GS4I_IMAGE_REACH * h;
        surface->has_images = surface->kind == GS4I_SURFACE_FLAT;
        if (surface->kind != GS4I_SURFACE_CURVED) continue;
        for (i = 0; i < 27; i++) {
            const int patch = gs4i_patch_of(sim, collider, g->neighbour[27 * o + i]);
            if (patch < 0) continue;
            surface->nearest = gs4i_min(surface->nearest, all[patch].nearest);
            bend[0] = gs4i_min(bend[0], all[patch].bend[0]);
            bend[1] = gs4i_max(bend[1], all[patch].bend[1]);
        }
        surface->has_images = surface->nearest < GS4I_IMAGE_REACH * h
                              && bend[0] < GS4I_IMAGE_BEND * h && bend[1] > -GS4I_IMAGE_BEND * h;
    }
}

/* The patches of all sticky bodies; those of bodies at rest are made anew where blocks or bodies
 * have changed. */
static int gs4i_sample_patches(gs4_sim *sim)
{
    gs4i_patches *p = &sim->image_particles.patches;
    const int hold = gs4i_patches_hold(sim), kept = hold ? p->still : 0;
    const size_t nodes = GS4I_BLOCK_NODES * sizeof(gs4_real),
                 surfaces = (size_t)sim->boundary.collider_count * (size_t)sim->grid.occupied
                            * sizeof(gs4i_surface);
    gs4i_pass pass;
    int i, moving;
    p->collider_count = -1;
    p->active = sim->grid.active;
    p->count = kept;
    if (!gs4i_scratch_reserve(
            &sim->memory, &p->of,
            (size_t)sim->boundary.collider_count * (size_t)p->active * sizeof(int32_t), 0)
        || !gs4i_scratch_reserve(&sim->memory, &p->surfaces, surfaces, hold ? surfaces : 0))
        return gs4i_fail_memory(&sim->error);
    if (!hold)
        memset(p->of.data, 0,
               (size_t)sim->boundary.collider_count * (size_t)p->active * sizeof(int32_t));
    for (moving = hold; moving < 2; moving++) {
        for (i = 0; i < sim->boundary.collider_count; i++) {
            const gs4i_collider *b = &sim->boundary.colliders[i];
            if (gs4i_is_sticky(b) && gs4i_is_moving(b) == moving)
                GS4I_TRY(gs4i_list_patches(sim, i));
        }
        if (!moving) p->still = p->count;
    }
    if (!gs4i_scratch_reserve(&sim->memory, &p->distance, (size_t)p->count * nodes,
                              (size_t)kept * nodes)
        || !gs4i_scratch_reserve(&sim->memory, &p->nodes, (size_t)p->count * 4 * nodes,
                                 (size_t)kept * 4 * nodes))
        return gs4i_fail_memory(&sim->error);
    pass.sim = sim;
    pass.blocks = NULL;
    pass.count = kept;
    gs4i_parallel_for(&sim->tasks, p->count - kept, gs4i_sample_distances, &pass);
    gs4i_parallel_for(&sim->tasks, p->count - kept, gs4i_sample_patch, &pass);
    for (i = 0; i < sim->boundary.collider_count; i++)
        if (gs4i_is_sticky(&sim->boundary.colliders[i])
            && (!hold || gs4i_is_moving(&sim->boundary.colliders[i])))
            gs4i_finish_surfaces(sim, i);
    return sim->bad_distance ? GS4_OK : gs4i_keep_patches(sim);
}

/* Is a sticky body within three cells of what particles of occupied block o see? */
static int gs4i_sticks_by(const gs4_sim *sim, int collider, int o)
{
    return gs4i_is_sticky(&sim->boundary.colliders[collider])
           && gs4i_surface_of(sim, collider, o)->nearest < GS4I_IMAGE_REACH * sim->grid.h;
}

/* Is any? Not in scenes with solids: what slides on one keeps its velocity. */
static int gs4i_sticks_near(const gs4_sim *sim, int o)
{
    int i;
    for (i = 0; i < sim->boundary.collider_count && !sim->particles.deformation_reals; i++)
        if (gs4i_sticks_by(sim, i, o)) return 1;
    return 0;
}

/* Rates of gs4i_near_decay by one body, of the nodes in a row of the tile of occupied block o: the
 * greater of them and of what the fourth numbers of the row are. */
static void gs4i_add_near_decay(const gs4_sim *sim, int collider, int o, int row, gs4_real *tile)
{
    const gs4i_surface *surface = gs4i_surface_of(sim, collider, o);
    const gs4_real *nodes = (const gs4_real *)sim->image_particles.patches.nodes.data;
    const int y = (row & 7) + 2, z = (row >> 3) + 2;
    const int32_t *slots = sim->grid.neighbour + 27 * o + 3 * (3 * (z >> 2) + (y >> 2));
    int x, patch[3];
    for (x = 0; x < 3; x++) patch[x] = gs4i_patch_of(sim, collider, slots[x]);
    for (x = 2; x < GS4I_TILE + 2; x++, tile += 4) {
        gs4_real rate = 0;
        if (surface->kind == GS4I_SURFACE_FLAT) {
            const gs4_vec3 from = gs4i_scale(
                gs4i_vec3(GS4I_C(x - 5.5), GS4I_C(y - 5.5), GS4I_C(z - 5.5)), sim->grid.h);
            rate = gs4i_near_decay(sim, &sim->boundary.colliders[collider],
                                   gs4i_add(surface->at, from),
                                   surface->d + gs4i_dot(surface->n, from));
        } else if (patch[x >> 2] >= 0) {
            rate =
                nodes[(ptrdiff_t)patch[x >> 2] * GS4I_NODE_REALS + 4 * gs4i_place_of(x, y, z) + 3];
        }
        tile[3] = gs4i_max(tile[3], rate);
    }
}

/* Let the fourth numbers in rows of a tile of occupied block o be rates of gs4i_near_decay. Returns
 * whether there may be any. */
static int gs4i_load_near_decay(const gs4_sim *sim, int o, uint64_t rows, gs4_real *tile)
{
    int sticks = 0, row, i;
    for (i = 0; i < sim->boundary.collider_count; i++) {
        if (!gs4i_is_moving(&sim->boundary.colliders[i]) || !gs4i_sticks_by(sim, i, o)) continue;
        for (row = 0; row < GS4I_TILE_REALS && !sticks; row += 4) tile[row + 3] = 0;
        sticks = 1;
        for (row = 0; row < GS4I_TILE * GS4I_TILE; row++)
            if (rows >> row & 1) gs4i_add_near_decay(sim, i, o, row, tile + 4 * GS4I_TILE * row);
    }
    return sticks;
}

/* Nodes of the tile of occupied block o which say of every particle that they are nearest to that
 * it is outside of all sticky bodies: bit 8 y + x of each z. Returns NULL if none is within three
 * cells of them: no particle gets there in a step. */
static const uint64_t *gs4i_find_clear_nodes(const gs4_sim *sim, int o, uint64_t clear[GS4I_TILE])
{
    const gs4i_patch *all = (const gs4i_patch *)sim->image_particles.patches.all.data;
    int any = 0, k, i, row;
    memset(clear, 0xff, GS4I_TILE * sizeof *clear);
    for (k = 0; k < sim->boundary.collider_count; k++) {
        const gs4i_surface *surface;
        uint64_t of[27];
        if (!gs4i_sticks_by(sim, k, o)) continue;
        any = 1;
        surface = gs4i_surface_of(sim, k, o);
        if (!(surface->nearest < GS4I_C(1.32) * sim->grid.h))
            continue; /* 1.5 sqrt(3)/2, and more */
        for (i = 0; i < 27; i++) {
            const int patch = gs4i_patch_of(sim, k, sim->grid.neighbour[27 * o + i]);
            of[i] = surface->kind == GS4I_SURFACE_FLAT ? 0
                    : patch < 0                        ? ~(uint64_t)0
                                                       : all[patch].clear;
        }
        for (row = 0; row < GS4I_TILE * GS4I_TILE; row++) {
            const int y = (row & 7) + 2, z = (row >> 3) + 2, place = gs4i_place_of(0, y, z);
            const uint64_t *three = of + 3 * (3 * (z >> 2) + (y >> 2)),
                           bits = (three[0] >> place & 15) >> 2 | (three[1] >> place & 15) << 2
                                  | (three[2] >> place & 3) << 6;
            clear[row >> 3] &= ~((uint64_t)0xff << 8 * (row & 7)) | bits << 8 * (row & 7);
        }
    }
    return any ? clear : NULL;
}

/* Is a particle of occupied block o inside of a sticky body, where it ended at p? `node` is that of
 * its tile which is nearest to it, -1: none is. Bodies are asked only where their patches do not
 * know. */
static int gs4i_is_in_sticky(const gs4_sim *sim, int o, gs4_vec3 p, int node, gs4_real away2)
{
    const gs4_real h = sim->grid.h;
    int i;
    for (i = 0; i < sim->boundary.collider_count; i++) {
        const gs4i_collider *body = &sim->boundary.colliders[i];
        const gs4i_surface *surface;
        if (!gs4i_is_sticky(body)) continue;
        surface = gs4i_surface_of(sim, i, o);
        if (node >= 0
            && (!(surface->nearest < GS4I_C(1.32) * h)
                || (surface->kind == GS4I_SURFACE_FLAT
                        ? surface->d + gs4i_dot(surface->n, gs4i_sub(p, surface->at))
                              > GS4I_C(0.01) * h
                        : gs4i_is_outside(gs4i_tile_distance(sim, i, o, node), away2, h))))
            continue;
        if (gs4i_collider_distance(body, p) < 0) return 1;
    }
    return 0;
}

/* Which of n particles of occupied block o are inside of a sticky body where they ended, at x? A
 * bit each. */
static unsigned gs4i_ended_inside(const gs4_sim *sim, int o, const uint64_t clear[GS4I_TILE],
                                  const gs4_real *x, int n)
{
    const gs4i_frame frame = gs4i_tile_frame(&sim->grid, sim->grid.occupied_block[o]);
    gs4i_lanes at[4], away2;
    gs4i_stencils s;
    unsigned inside = 0;
    int b;
    gs4i_to_lanes(x, n, at);
    gs4i_stencils_at(&s, &frame, at);
    GS4I_BATCH_LOOP(b)
        away2[b] = s.xi[0][b] * s.xi[0][b] + s.xi[1][b] * s.xi[1][b] + s.xi[2][b] * s.xi[2][b];
    for (b = 0; b < n; b++) {
        const int node = s.base[b] < 0 ? -1 : s.base[b] + 1 + GS4I_TILE + GS4I_TILE * GS4I_TILE;
        if (node >= 0 && (clear[node >> 6] >> (node & 63) & 1)) continue;
        if (gs4i_is_in_sticky(sim, o, gs4i_vec3(x[4 * b], x[4 * b + 1], x[4 * b + 2]), node,
                              GS4I_NTH(away2, b)))
            inside |= 1u << b;
    }
    return inside;
}

/* A tile from what the 27 blocks around it have, four numbers a node: `none` and three times 0
 * where there is nothing. */
static void gs4i_load_around(const gs4_real *const of[27], gs4_real none, gs4_real *tile)
{
    static const int from[3] = { 8, 0, 0 }, to[3] = { 0, 8, 24 }, count[3] = { 8, 16, 8 };
    int row, i, k;
    for (row = 0; row < GS4I_TILE * GS4I_TILE; row++, tile += 4 * GS4I_TILE) {
        const int y = (row & 7) + 2, z = (row >> 3) + 2, place = 4 * gs4i_place_of(0, y, z);
        for (i = 0; i < 3; i++) {
            const gs4_real *four = of[3 * (3 * (z >> 2) + (y >> 2)) + i];
            gs4_real *out = tile + to[i];
            if (four) {
                memcpy(out, four + place + from[i], (size_t)count[i] * sizeof *out);
                continue;
            }
            memset(out, 0, (size_t)count[i] * sizeof *out);
            for (k = 0; k < count[i]; k += 4) out[k] = none;
        }
    }
    memset(tile, 0, 16 * sizeof *tile);
}

/* What the patches of a body have around occupied block o; elsewhere it is at least as far. */
static void gs4i_load_patches(const gs4_sim *sim, int collider, int o, gs4_real *tile)
{
    const gs4_real *nodes = (const gs4_real *)sim->image_particles.patches.nodes.data, *of[27];
    int i;
    for (i = 0; i < 27; i++) {
        const int patch = gs4i_patch_of(sim, collider, sim->grid.neighbour[27 * o + i]);
        of[i] = patch < 0 ? NULL : nodes + (ptrdiff_t)patch * GS4I_NODE_REALS;
    }
    gs4i_load_around(of, (GS4I_IMAGE_REACH + GS4I_NODES_REACH) * sim->grid.h, tile);
}

/* The least distance of the 27 nodes from each node of a tile on: no particle that sees them is
 * nearer, as weights are positive. */
static void gs4i_find_least(const gs4_real *tile, gs4_real *least)
{
    const int nodes = GS4I_TILE * GS4I_TILE * GS4I_TILE;
    int apart, i;
    for (i = 0; i < nodes; i++) least[i] = tile[4 * i];
    for (apart = 1; apart < nodes; apart *= GS4I_TILE)
        for (i = 0; i < nodes - 2 * apart; i++)
            least[i] = gs4i_min(least[i], gs4i_min(least[i + apart], least[i + 2 * apart]));
}

/* Where a point at p is reflected to. */
GS4I_INLINE gs4_vec3 gs4i_reflected(const gs4i_near_particle *g, gs4_vec3 p)
{
    const gs4_vec3 down = gs4i_scale(gs4i_vec3(g->n[0], g->n[1], g->n[2]), g->d);
    return gs4i_sub(gs4i_sub(p, down), down);
}

/* Slot that the image of a particle at p is given to, or -1. A tile has room for a cell around its
 * block. */
static int gs4i_slot_of_image(const gs4i_grid *grid, const gs4i_near_particle *g, gs4_vec3 p)
{
    const gs4_vec3 at = gs4i_reflected(g, p);
    const gs4_real image[3] = { at.x, at.y, at.z },
                   nearer[3] = { at.x + grid->h * g->n[0], at.y + grid->h * g->n[1],
                                 at.z + grid->h * g->n[2] };
    const int slot = gs4i_slot_at(grid, image);
    return slot < 0 ? gs4i_slot_at(grid, nearer) : slot;
}

/* Has a particle at p an image? It can be had where the body is flat and thick enough: a point one
 * and a half cells behind the surface is as deep in the body, within a quarter of a cell. `image`
 * is the image's slot then for now. */
static void gs4i_seek_image(const gs4i_grid *grid, gs4_vec3 p, gs4i_near_particle *g)
{
    const gs4_real h = grid->h, length = gs4i_length(gs4i_vec3(g->n[0], g->n[1], g->n[2]));
    int c;
    g->image = GS4I_NO_IMAGE;
    if (!(length > 0)) return;
    for (c = 0; c < 3; c++) g->n[c] *= 1 / length;
    if (g->d > -GS4I_C(0.5) * h && gs4i_abs(g->bend) < GS4I_IMAGE_BEND * h) {
        g->image = gs4i_slot_of_image(grid, g, p); /* -1: there are no nodes */
    } else if (g->d < (GS4I_STICKY_REACH + GS4I_IMAGE_NODES) * h)
        /* farther away it sees next to nothing of nodes that would be held */
        g->image = GS4I_HOLDS_NODES;
}

/* A particle at p is near body number `collider`, by what it has of the numbers of a patch. */
static void gs4i_meet_particle(const gs4i_grid *grid, int collider, const gs4_real four[4],
                               gs4_vec3 n, gs4_vec3 p, gs4i_near_particle *g)
{
    if (!(four[0] < g->d)) return;
    g->d = four[0];
    g->bend = four[1];
    g->curvature = four[2];
    g->n[0] = n.x;
    g->n[1] = n.y;
    g->n[2] = n.z;
    g->body = collider;
    gs4i_seek_image(grid, p, g);
}

/* How far the particles of occupied block o are from a body. */
static void gs4i_meet_body(const gs4_sim *sim, int collider, int o, gs4i_near_particle *g)
{
    const gs4i_grid *grid = &sim->grid;
    const gs4i_frame frame = gs4i_tile_frame(grid, grid->occupied_block[o]);
    const gs4_real deep = GS4I_IMAGE_NODES * grid->h;
    const gs4i_surface *surface = gs4i_surface_of(sim, collider, o);
    const gs4_real reach = GS4I_IMAGE_REACH * grid->h;
    gs4_real tile[GS4I_TILE_REALS], least[GS4I_TILE * GS4I_TILE * GS4I_TILE];
    size_t i = (size_t)grid->first[o], end = (size_t)grid->first[o + 1];
    if (surface->kind == GS4I_SURFACE_FAR || !(surface->nearest < reach)) return;
    if (surface->kind == GS4I_SURFACE_CURVED) {
        gs4i_load_patches(sim, collider, o, tile);
        gs4i_find_least(tile, least);
    }
    for (; i < end; i += GS4I_BATCH) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_lanes x[3];
        gs4i_stencils s;
        gs4i_gathered u;
        int b;
        gs4i_load_batch(&sim->particles, i, n, sim->integrator.prediction, &q);
        gs4i_predict_positions(&q, sim->integrator.prediction, x);
        gs4i_stencils_at(&s, &frame, x);
        for (b = 0; b < n; b++, g++) {
            const gs4_vec3 p = gs4i_vec3(GS4I_NTH(x[0], b), GS4I_NTH(x[1], b), GS4I_NTH(x[2], b));
            gs4i_row w, dw;
            gs4_vec3 slope;
            g->base = s.base[b];
            if (g->base < 0) continue; /* it will be sorted first */
            if (surface->kind == GS4I_SURFACE_FLAT) {
                u.value[0] = surface->d + gs4i_dot(surface->n, gs4i_sub(p, surface->at));
                u.value[1] = u.value[0] > -deep ? GS4I_C(0) : grid->h;
                u.value[2] = 0;
                gs4i_meet_particle(grid, collider, u.value, surface->n, p, g);
                continue;
            }
            if (!(least[g->base] < reach)) continue;
            gs4i_x_weights(&s, b, &w, &dw);
            gs4i_gather_local(tile + 4 * s.base[b], &s, b, &w, &dw, &u);
            slope = gs4i_vec3(u.dx[4 * b], u.dy[4 * b], u.dz[4 * b]);
            gs4i_meet_particle(grid, collider, u.value + 4 * b, slope, p, g);
        }
    }
}

/* Particles of one block and their images; particle NULL where it is near no sticky body. */
typedef struct gs4i_near_particles {
    gs4i_near_particle *particle;
    gs4i_image_particle *images; /* all */
    gs4_real inv_h;
} gs4i_near_particles;

GS4I_INLINE gs4i_near_particles gs4i_near_particles_of(const gs4_sim *sim, int o)
{
    const gs4i_image_particles *g = &sim->image_particles;
    gs4i_near_particles near;
    near.particle = NULL;
    near.images = (gs4i_image_particle *)g->all.data;
    near.inv_h = sim->grid.inv_h;
    if (g->near && ((const int32_t *)g->of.data)[o] >= 0)
        near.particle =
            (gs4i_near_particle *)g->of_particles.data + ((const int32_t *)g->of.data)[o];
    return near;
}

/* Where the surface is from the particles of a block, which of them have images, and how many. */
static void gs4i_find_near_particles(int index, void *context)
{
    const gs4_sim *sim = ((const gs4i_pass *)context)->sim;
    const gs4i_grid *grid = &sim->grid;
    gs4i_near_particle *g = gs4i_near_particles_of(sim, index).particle;
    const int n = grid->first[index + 1] - grid->first[index];
    int32_t *count = (int32_t *)sim->image_particles.first_of.data + index;
    int k;
    *count = 0;
    if (!g) return;
    for (k = 0; k < n; k++) {
        g[k].d = GS4I_IMAGE_REACH * grid->h;
        g[k].body = g[k].base = -1;
        g[k].image = GS4I_NO_IMAGE;
    }
    for (k = 0; k < sim->boundary.collider_count; k++)
        if (gs4i_is_sticky(&sim->boundary.colliders[k])) gs4i_meet_body(sim, k, index, g);
    for (k = 0; k < n; k++) *count += g[k].image >= 0;
}

/* Volume of the image over that of the particle: behind a ball of radius R and before it lie shells
 * of (R - d)^2 and (R + d)^2, the curvature is 2/(R + d). 0 beyond the midst of the ball, 4 at most
 * in a hollow (chosen). With 1 images packed too densely pushed liquid off balls (J .94 to 1.07
 * beside one of 4 cells that slides, now .97 to 1.03). */
GS4I_INLINE gs4_real gs4i_image_part(const gs4i_near_particle *g)
{
    /* lap d of what is flat but sampled, as meshes are, has noise */
    const gs4_real k = g->d * g->curvature, sure = gs4i_max(gs4i_abs(k) - GS4I_C(0.1), 0);
    const gs4_real t = gs4i_max(1 - (k < 0 ? -sure : sure), 0);
    return gs4i_min(t * t, 4);
}

/* Of the odd part of what a particle sees that is d before the surface. */
GS4I_INLINE gs4_real gs4i_odd_share(gs4_real d, gs4_real inv_h)
{
    return gs4i_max(gs4i_min(GS4I_IMAGE_NODES - d * inv_h, 1), 0);
}

/* The image of a particle at p. */
static void gs4i_place_image_particle(const gs4_sim *sim, gs4_vec3 p,
                                      const gs4i_near_particle *near, gs4i_image_particle *g)
{
    const gs4i_collider *collider = &sim->boundary.colliders[near->body];
    const gs4_real d = near->d;
    const gs4_vec3 n = gs4i_vec3(near->n[0], near->n[1], near->n[2]),
                   foot = gs4i_sub(p, gs4i_scale(n, d)), image = gs4i_reflected(near, p),
                   v = gs4i_collider_velocity(collider, foot);
    g->x[0] = image.x;
    g->x[1] = image.y;
    g->x[2] = image.z;
    g->n[0] = n.x;
    g->n[1] = n.y;
    g->n[2] = n.z;
    g->v[0] = v.x;
    g->v[1] = v.y;
    g->v[2] = v.z;
    g->spin[0] = collider->is.angular_velocity.x;
    g->spin[1] = collider->is.angular_velocity.y;
    g->spin[2] = collider->is.angular_velocity.z;
    g->share = gs4i_odd_share(d, sim->grid.inv_h);
    g->part = gs4i_image_part(near);
    g->whole = 0;
    g->slot = near->image;
}

/* Columns of spin x (I - n n), how the body's velocity changes along its surface. */
GS4I_INLINE void gs4i_surface_spin(const gs4i_image_particle *g, gs4_real turn[3][3])
{
    const gs4_real *w = g->spin, *n = g->n;
    const gs4_real columns[3][3] = { { 0, w[2], -w[1] }, { -w[2], 0, w[0] }, { w[1], -w[0], 0 } };
    const gs4_real across[3] = { w[1] * n[2] - w[2] * n[1], w[2] * n[0] - w[0] * n[2],
                                 w[0] * n[1] - w[1] * n[0] };
    int a, c;
    for (a = 0; a < 3; a++)
        for (c = 0; c < 3; c++) turn[a][c] = columns[a][c] - across[c] * n[a];
}

/* A solid's particle turns as well, with w = own[0..2] + ahead own[3..5]: of its image, columns of
 * how its momentum changes from node to node, 2 m spin x (I - n n) - m w x R. */
static void gs4i_reflect_spin(gs4i_image_particle *g, const gs4_real own[6], gs4_real ahead,
                              gs4_real h)
{
    const gs4_real *n = g->n, m = g->x[3] * h;
    const gs4_real w[3] = { own[0] + ahead * own[3], own[1] + ahead * own[4],
                            own[2] + ahead * own[5] };
    gs4_real turn[3][3];
    int a, c;
    if (w[0] == 0 && w[1] == 0 && w[2] == 0) return;
    gs4i_surface_spin(g, turn);
    for (a = 0; a < 3; a++) {
        gs4_real e[3] = { 0, 0, 0 };
        e[a] = 1;
        for (c = 0; c < 3; c++) e[c] -= 2 * n[a] * n[c];
        for (c = 0; c < 3; c++) {
            const int i = (c + 1) % 3, j = (c + 2) % 3;
            g->carried[1 + a][c] = m * (2 * turn[a][c] - (w[i] * e[j] - w[j] * e[i]));
        }
    }
}

static void gs4i_place_image_particles(int index, void *context)
{
    gs4_sim *sim = ((const gs4i_pass *)context)->sim;
    const gs4i_particles *p = &sim->particles;
    const gs4_real ahead = sim->integrator.prediction.ahead;
    gs4i_near_particle *near = gs4i_near_particles_of(sim, index).particle;
    const int32_t *first_of = (const int32_t *)sim->image_particles.first_of.data + index;
    gs4i_image_particle *g = (gs4i_image_particle *)sim->image_particles.all.data + *first_of;
    int32_t number = *first_of;
    size_t i = (size_t)sim->grid.first[index], end = (size_t)sim->grid.first[index + 1];
    for (; i < end && number < first_of[1]; i += GS4I_BATCH) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_lanes x[3];
        int b, c;
        gs4i_load_batch(p, i, n, sim->integrator.prediction, &q);
        gs4i_predict_positions(&q, sim->integrator.prediction, x);
        for (b = 0; b < n; b++, near++) {
            if (near->image < 0) continue;
            gs4i_place_image_particle(
                sim, gs4i_vec3(GS4I_NTH(x[0], b), GS4I_NTH(x[1], b), GS4I_NTH(x[2], b)), near, g);
            near->image = number++;
            g->x[3] = g->part * GS4I_NTH(q.x[3], b);
            memset(g->carried, 0, sizeof g->carried);
            for (c = 0; c < 3; c++)
                g->carried[0][c] =
                    g->x[3] * (2 * g->v[c] - GS4I_NTH(q.v[c], b) - ahead * GS4I_NTH(q.a[c], b));
            g->carried[0][3] = g->x[3];
            if (p->with_rates && p->deformation_reals)
                gs4i_reflect_spin(
                    g, p->deformation + (size_t)p->deformation_reals * (i + (size_t)b) + 18, ahead,
                    sim->grid.h);
            g++;
        }
    }
}

/* Sort images by slot, stably, and the slots by colour. */
static int gs4i_sort_image_particles(gs4_sim *sim)
{
    gs4i_image_particles *g = &sim->image_particles;
    const gs4i_image_particle *all = (const gs4i_image_particle *)g->all.data;
    const int active = sim->grid.active;
    int32_t *order = (int32_t *)gs4i_scratch_reserve(&sim->memory, &g->order,
                                                     (size_t)g->count * sizeof *order, 0);
    int32_t *first = (int32_t *)gs4i_scratch_reserve(&sim->memory, &g->first,
                                                     (size_t)(active + 1) * sizeof *first, 0);
    int32_t *slots =
        (int32_t *)gs4i_scratch_reserve(&sim->memory, &g->slots, (size_t)active * sizeof *slots, 0);
    int k, s, colour, n = 0;
    if (!order || !first || !slots) return gs4i_fail_memory(&sim->error);
    memset(first, 0, (size_t)(active + 1) * sizeof *first);
    for (k = 0; k < g->count; k++) first[all[k].slot + 1]++;
    for (colour = 0; colour < 8; colour++) {
        g->colour_first[colour] = n;
        for (s = 0; s < active; s++)
            if (first[s + 1] && gs4i_block_colour(&sim->grid, sim->grid.block[s]) == colour)
                slots[n++] = s;
    }
    g->colour_first[8] = n;
    for (s = 0; s < active; s++) first[s + 1] += first[s];
    for (k = 0; k < g->count; k++) order[first[all[k].slot]++] = k;
    for (s = active; s > 0; s--) first[s] = first[s - 1];
    first[0] = 0;
    return GS4_OK;
}

/* Count the particles of blocks near sticky bodies, if any in the scene may have images. */
static int gs4i_count_near_particles(gs4_sim *sim)
{
    const gs4i_grid *grid = &sim->grid;
    gs4i_image_particles *g = &sim->image_particles;
    int32_t *of = (int32_t *)gs4i_scratch_reserve(&sim->memory, &g->of,
                                                  (size_t)grid->occupied * sizeof *of, 0);
    int i, o, has_images = 0;
    if (!of) return gs4i_fail_memory(&sim->error);
    for (o = 0; o < grid->occupied; o++) {
        of[o] = -1;
        for (i = 0; i < sim->boundary.collider_count; i++) {
            if (!gs4i_is_sticky(&sim->boundary.colliders[i])) continue;
            has_images |= gs4i_surface_of(sim, i, o)->has_images;
            if (gs4i_surface_of(sim, i, o)->kind != GS4I_SURFACE_FAR) of[o] = g->near;
        }
        if (of[o] >= 0) g->near += grid->first[o + 1] - grid->first[o];
    }
    if (!has_images) g->near = 0;
    return GS4_OK;
}

/* Find the images of all particles where they are at the stage. */
static int gs4i_find_image_particles(gs4_sim *sim)
{
    gs4i_image_particles *g = &sim->image_particles;
    const size_t blocks = (size_t)sim->grid.occupied + 1;
    gs4i_pass pass;
    int32_t *first_of;
    int i, sticky = 0;
    g->near = g->count = g->patches.count = 0;
    for (i = 0; i < sim->boundary.collider_count; i++)
        sticky |= gs4i_is_sticky(&sim->boundary.colliders[i]);
    if (!sticky) return GS4_OK;
    GS4I_TRY(gs4i_sample_patches(sim));
    GS4I_TRY(gs4i_count_near_particles(sim));
    if (!g->near) return GS4_OK;
    first_of =
        (int32_t *)gs4i_scratch_reserve(&sim->memory, &g->first_of, blocks * sizeof *first_of, 0);
    if (!first_of
        || !gs4i_scratch_reserve(&sim->memory, &g->of_particles,
                                 (size_t)g->near * sizeof(gs4i_near_particle), 0)) {
        g->near = 0;
        return gs4i_fail_memory(&sim->error);
    }
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    gs4i_parallel_for(&sim->tasks, sim->grid.occupied, gs4i_find_near_particles, &pass);
    for (i = 0; i < sim->grid.occupied; i++) {
        const int32_t count = first_of[i];
        first_of[i] = g->count;
        g->count += count;
    }
    first_of[i] = g->count;
    if (g->count
        && !gs4i_scratch_reserve(&sim->memory, &g->all,
                                 (size_t)g->count * sizeof(gs4i_image_particle), 0)) {
        g->near = g->count = 0;
        return gs4i_fail_memory(&sim->error);
    }
    if (!g->count) return GS4_OK;
    gs4i_parallel_for(&sim->tasks, sim->grid.occupied, gs4i_place_image_particles, &pass);
    return gs4i_sort_image_particles(sim);
}

/* The next n image particles of a slot and their weights. */
static void gs4i_load_image_particles(gs4i_image_particle *all, const int32_t *order, int n,
                                      const gs4i_surroundings *t,
                                      gs4i_image_particle *g[GS4I_BATCH], gs4i_stencils *s)
{
    gs4_real four[4 * GS4I_BATCH];
    gs4i_lanes x[4];
    int b;
    for (b = 0; b < n; b++) {
        g[b] = all + order[b];
        memcpy(four + 4 * b, g[b]->x, 4 * sizeof *four);
    }
    gs4i_to_lanes(four, n, x);
    gs4i_stencils_at(s, &t->frame, x);
}

/* Mark the nodes that particles of a block reach which have no image. */
static void gs4i_mark_lacking_images(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    const gs4i_grid *grid = &pass->sim->grid;
    const int o = pass->blocks[index], count = grid->first[o + 1] - grid->first[o];
    const gs4i_near_particle *near = gs4i_near_particles_of(pass->sim, o).particle;
    uint64_t lack[GS4I_TILE] = { 0, 0, 0, 0, 0, 0, 0, 0 }, any = 0; /* bit 8 y + x of each z */
    int i, row;
    for (i = 0; near && i < count; i++, near++)
        if (near->image == GS4I_HOLDS_NODES && near->base >= 0) {
            const uint64_t seen = (uint64_t)0x070707u << near->base % 64;
            int k;
            for (k = 0; k < 3; k++) lack[near->base / 64 + k] |= seen;
            any = 1;
        }
    for (row = 0; row < GS4I_TILE * GS4I_TILE && any; row++) {
        ptrdiff_t at[3];
        gs4i_tile_row(grid, o, row & 7, row >> 3, at);
        for (i = 0; i < GS4I_TILE; i++) {
            const uint32_t node = (uint32_t)(at[(i + 2) >> 2] / 4) + (uint32_t)((i + 2) & 3);
            if (lack[row >> 3] >> (8 * (row & 7) + i) & 1
                && gs4i_has_jumps(grid, gs4i_slot_of(node)))
                grid->flags[node] |= GS4I_LACKS_IMAGE;
        }
    }
}

/* Do all nodes around a particle exist? Three in a row lie in two blocks at most. */
static int gs4i_is_whole(const gs4i_surroundings *t, int base)
{
    const int x = base % GS4I_TILE, y = base / GS4I_TILE % GS4I_TILE,
              z = base / (GS4I_TILE * GS4I_TILE);
    int i, whole = 1;
    for (i = 0; i < 8; i++)
        whole &= gs4i_surrounding_node(t, x + 2 * (i & 1), y + (i & 2), z + 2 * (i >> 2)) >= 0;
    return whole;
}

/* Do all nodes of a tile exist? */
static int gs4i_is_complete(const gs4i_surroundings *t)
{
    int i, all = 1;
    for (i = 0; i < 27; i++) all &= t->slot[i] >= 0;
    return all;
}

/* Add the touched rows of a tile to the nodes that exist and are not held; those that get momentum
 * are marked. */
static void gs4i_add_to_surroundings(const gs4i_grid *grid, const gs4i_surroundings *t,
                                     uint64_t rows, const gs4_real *tile, gs4_real *field)
{
    int row, x, c;
    for (row = 0; row < GS4I_TILE * GS4I_TILE; row++, tile += 4 * GS4I_TILE) {
        const int y = (row & 7) + 2, z = (row >> 3) + 2,
                  *slots = t->slot + 3 * (3 * (z >> 2) + (y >> 2));
        if (!(rows >> row & 1)) continue;
        for (x = 2; x < GS4I_TILE + 2; x++) {
            const int slot = slots[x >> 2];
            const uint32_t node = gs4i_first_node(slot) + (uint32_t)gs4i_place_of(x, y, z);
            const gs4_real *four = tile + 4 * (x - 2);
            gs4_real *to;
            if (slot < 0 || (grid->flags[node] & GS4I_LACKS_IMAGE)) continue;
            to = gs4i_of_node(field, node);
            for (c = 0; c < 4; c++) to[c] += four[c];
            if (field == grid->momentum && four[3] > 0 && gs4i_has_jumps(grid, slot))
                grid->flags[node] |= GS4I_IMAGED;
        }
    }
}

static void gs4i_scatter_image_block(const gs4i_pass *pass, int index, int what)
{
    gs4_sim *sim = pass->sim;
    const int slot = pass->blocks[index];
    const int32_t *first = (const int32_t *)sim->image_particles.first.data,
                  *order = (const int32_t *)sim->image_particles.order.data;
    gs4_real tile[GS4I_TILE_REALS];
    gs4i_surroundings t;
    uint64_t rows = 0;
    int k, b, c, complete;
    gs4i_surroundings_of(&sim->grid, slot, &t);
    complete = gs4i_is_complete(&t);
    memset(tile, 0, sizeof tile);
    for (k = first[slot]; k < first[slot + 1]; k += GS4I_BATCH) {
        const int n = first[slot + 1] - k < GS4I_BATCH ? first[slot + 1] - k : GS4I_BATCH;
        gs4i_image_particle *g[GS4I_BATCH];
        gs4i_stencils s;
        gs4i_forces f;
        gs4i_affine_forces m;
        gs4i_load_image_particles((gs4i_image_particle *)sim->image_particles.all.data, order + k,
                                  n, &t, g, &s);
        for (b = 0; b < n; b++) {
            gs4_real(*from)[4] = g[b]->carried;
            const size_t four = 4 * sizeof *tile;
            if (s.base[b] < 0) continue;
            rows |= gs4i_touched_rows(s.base[b]);
            if (what != GS4I_IMAGE_FORCE) g[b]->whole = complete || gs4i_is_whole(&t, s.base[b]);
            if (what == GS4I_IMAGE_MOMENTUM)
                gs4i_scatter_quad(tile, &s, b, from[0]);
            else if (what == GS4I_IMAGE_FORCE) {
                memcpy(f.x + 4 * b, from[0], four);
                memcpy(f.y + 4 * b, from[1], four);
                memcpy(f.z + 4 * b, from[2], four);
                memcpy(f.weight + 4 * b, from[3], four);
                gs4i_scatter_force(tile, &s, b, &f);
            } else {
                memcpy(m.middle + 4 * b, from[0], four);
                memcpy(m.x + 4 * b, from[1], four);
                memcpy(m.y + 4 * b, from[2], four);
                memcpy(m.z + 4 * b, from[3], four);
                for (c = 0; c < 3; c++)
                    m.middle[4 * b + c] -= from[1][c] * GS4I_NTH(s.xi[0], b)
                                           + from[2][c] * GS4I_NTH(s.xi[1], b)
                                           + from[3][c] * GS4I_NTH(s.xi[2], b);
                gs4i_scatter_affine(tile, &s, b, &m);
            }
        }
    }
    gs4i_add_to_surroundings(&sim->grid, &t, rows, tile,
                             what == GS4I_IMAGE_FORCE ? sim->grid.force : sim->grid.momentum);
}

static void gs4i_scatter_image_momentum(int index, void *context)
{
    gs4i_scatter_image_block((const gs4i_pass *)context, index, GS4I_IMAGE_MOMENTUM);
}

static void gs4i_scatter_image_affine(int index, void *context)
{
    gs4i_scatter_image_block((const gs4i_pass *)context, index, GS4I_IMAGE_AFFINE);
}

static void gs4i_scatter_image_force(int index, void *context)
{
    gs4i_scatter_image_block((const gs4i_pass *)context, index, GS4I_IMAGE_FORCE);
}

static void gs4i_scatter_image_particles(gs4_sim *sim, gs4_task_fn kernel)
{
    if (sim->image_particles.count)
        gs4i_scatter_by_colour(sim, (const int32_t *)sim->image_particles.slots.data,
                               sim->image_particles.colour_first, kernel);
}

/* What the nodes around a slot have of a field, 0 where there are none. */
static void gs4i_load_surroundings(const gs4i_surroundings *t, const gs4_real *field,
                                   gs4_real *tile)
{
    const gs4_real *of[27];
    int i;
    for (i = 0; i < 27; i++)
        of[i] = t->slot[i] < 0 ? NULL : field + (ptrdiff_t)t->slot[i] * GS4I_NODE_REALS;
    gs4i_load_around(of, 0, tile);
}

/* The next images of a slot, up to 16, of which particles take odd parts: from *k on. Returns how
 * many. */
static int gs4i_next_odd_images(const gs4i_image_particle *all, const int32_t *order, int *k,
                                int end, int32_t next[GS4I_BATCH])
{
    int n = 0;
    for (; *k < end && n < GS4I_BATCH; (*k)++) {
        const gs4i_image_particle *g = all + order[*k];
        if (g->share > 0 && g->whole) next[n++] = order[*k];
    }
    return n;
}

/* What the nodes have of a field at the images, velocity (what 0) or acceleration (1). */
static void gs4i_gather_image_block(const gs4i_pass *pass, int index, int what)
{
    gs4_sim *sim = pass->sim;
    gs4i_image_particle *all = (gs4i_image_particle *)sim->image_particles.all.data;
    const int slot = pass->blocks[index];
    const int32_t *first = (const int32_t *)sim->image_particles.first.data,
                  *order = (const int32_t *)sim->image_particles.order.data;
    const gs4_real *field = what ? sim->grid.force : gs4i_gradient_velocity(&sim->grid);
    gs4_real tile[GS4I_TILE_REALS];
    gs4i_surroundings t;
    int32_t next[GS4I_BATCH];
    int k = first[slot], n, b;
    gs4i_surroundings_of(&sim->grid, slot, &t);
    gs4i_load_surroundings(&t, field, tile);
    while ((n = gs4i_next_odd_images(all, order, &k, first[slot + 1], next)) > 0) {
        gs4i_image_particle *g[GS4I_BATCH];
        gs4i_stencils s;
        gs4i_gathered u;
        gs4i_load_image_particles(all, next, n, &t, g, &s);
        for (b = 0; b < n; b++) {
            gs4i_row w, d;
            if (s.base[b] < 0) continue;
            gs4i_x_weights(&s, b, &w, &d);
            if (what)
                gs4i_gather_rate(sim->particles.deformation_reals, tile + 4 * s.base[b], &s, b, &w,
                                 &d, &u);
            else
                gs4i_gather_local(tile + 4 * s.base[b], &s, b, &w, &d, &u);
            memcpy(g[b]->seen[what][0], u.value + 4 * b, 4 * sizeof *tile);
            if (what && !sim->particles.deformation_reals) continue;
            memcpy(g[b]->seen[what][1], u.dx + 4 * b, 4 * sizeof *tile);
            memcpy(g[b]->seen[what][2], u.dy + 4 * b, 4 * sizeof *tile);
            memcpy(g[b]->seen[what][3], u.dz + 4 * b, 4 * sizeof *tile);
        }
    }
}

static void gs4i_gather_image_velocity(int index, void *context)
{
    gs4i_gather_image_block((const gs4i_pass *)context, index, 0);
}

static void gs4i_gather_image_acceleration(int index, void *context)
{
    gs4i_gather_image_block((const gs4i_pass *)context, index, 1);
}

static void gs4i_gather_image_particles(gs4_sim *sim, gs4_task_fn kernel)
{
    gs4i_pass pass;
    if (!sim->image_particles.count) return;
    pass.sim = sim;
    pass.blocks = (const int32_t *)sim->image_particles.slots.data;
    pass.count = sim->image_particles.colour_first[8];
    gs4i_parallel_for(&sim->tasks, pass.count, kernel, &pass);
}

/* The image of particle i of a block, NULL: it has none. */
GS4I_INLINE gs4i_image_particle *gs4i_image_of(const gs4i_near_particles *near, int i)
{
    const int image = near->particle[i].image;
    return image < 0 ? NULL : near->images + image;
}

/* The image by which a particle takes an odd part, NULL: it takes none. */
GS4I_INLINE const gs4i_image_particle *gs4i_odd_image(const gs4i_near_particles *near, int i)
{
    const gs4i_image_particle *g = gs4i_image_of(near, i);
    return g && gs4i_odd_share(near->particle[i].d, near->inv_h) > 0 && g->whole ? g : NULL;
}

/* Replace the value that particle b gathered by its part that is odd about the surface, of
 * velocities (what 0) about the body's, by its share: u = (u(x) - u(x'))/2 + v */
GS4I_INLINE void gs4i_make_value_odd(const gs4i_image_particle *g, int b, int what,
                                     gs4i_gathered *u)
{
    int c;
    for (c = 0; c < 3; c++)
        u->value[4 * b + c] -= g->share
                               * (GS4I_C(0.5) * (u->value[4 * b + c] + g->seen[what][0][c])
                                  - (what ? GS4I_C(0) : g->v[c]));
}

/* The same of its gradient: grad u = (grad u(x) - grad u(x') R)/2 + spin x (I - n n). */
GS4I_INLINE void gs4i_make_gradient_odd(const gs4i_image_particle *g, int b, int what,
                                        gs4i_gathered *u)
{
    gs4_real *column[3], turn[3][3] = { { 0, 0, 0 }, { 0, 0, 0 }, { 0, 0, 0 } }, across[3];
    int c, a;
    column[0] = u->dx + 4 * b;
    column[1] = u->dy + 4 * b;
    column[2] = u->dz + 4 * b;
    if (!what) gs4i_surface_spin(g, turn);
    for (c = 0; c < 3; c++)
        across[c] = g->seen[what][1][c] * g->n[0] + g->seen[what][2][c] * g->n[1]
                    + g->seen[what][3][c] * g->n[2];
    for (a = 0; a < 3; a++)
        for (c = 0; c < 3; c++)
            column[a][c] -= g->share
                            * (GS4I_C(0.5) * (column[a][c] + g->seen[what][1 + a][c])
                               - across[c] * g->n[a] - turn[a][c]);
}

/* Both, of the velocities of n particles; where `acc` is given of accelerations too, of solids with
 * their gradients. */
static void gs4i_make_odd(const gs4i_near_particles *near, int n, int solids, gs4i_gathered *u,
                          gs4i_gathered *acc)
{
    int b;
    for (b = 0; b < n; b++) {
        const gs4i_image_particle *g = gs4i_odd_image(near, b);
        if (!g) continue;
        gs4i_make_value_odd(g, b, 0, u);
        gs4i_make_gradient_odd(g, b, 0, u);
        if (acc) gs4i_make_value_odd(g, b, 1, acc);
        if (acc && solids) gs4i_make_gradient_odd(g, b, 1, acc);
    }
}

/* Is what the images of block o see of velocity no cause for alarm? Of a reflection of L the
 * trace is at most sum |L_ij|. See gs4i_is_safe. */
static int gs4i_images_are_safe(const gs4_sim *sim, int o)
{
    const gs4i_image_particle *images = (const gs4i_image_particle *)sim->image_particles.all.data;
    const int32_t *first_of = (const int32_t *)sim->image_particles.first_of.data;
    int i;
    for (i = sim->image_particles.count ? first_of[o] : 0;
         sim->image_particles.count && i < first_of[o + 1]; i++) {
        const gs4i_image_particle *g = images + i;
        gs4_real moved = 0, all = 0;
        int a, c;
        if (!(g->whole && g->share > 0)) continue;
        for (c = 0; c < 3; c++) {
            moved += gs4i_abs(g->seen[0][0][c]) + 2 * gs4i_abs(g->v[c]);
            for (a = 1; a < 4; a++) all += gs4i_abs(g->seen[0][a][c]);
        }
        if (!(moved * sim->integrator.dt < sim->grid.h
              && all * sim->integrator.dt < GS4I_C(GS4I_SAFE_STRAIN)))
            return 0;
    }
    return 1;
}

/* -A R, of the columns x, y, z of n particles, for their images, by their parts. */
static void gs4i_reflect_columns(const gs4i_near_particles *near, int n, const gs4_real *x,
                                 const gs4_real *y, const gs4_real *z, int to)
{
    int b, c;
    for (b = 0; b < n; b++) {
        gs4i_image_particle *g = gs4i_image_of(near, b);
        for (c = 0; c < 3 && g; c++) {
            const gs4_real across =
                2 * g->part
                * (x[4 * b + c] * g->n[0] + y[4 * b + c] * g->n[1] + z[4 * b + c] * g->n[2]);
            g->carried[to][c] = across * g->n[0] - g->part * x[4 * b + c];
            g->carried[to + 1][c] = across * g->n[1] - g->part * y[4 * b + c];
            g->carried[to + 2][c] = across * g->n[2] - g->part * z[4 * b + c];
        }
    }
}

/* Forces of the images of n particles; mass is odd, as its weight is, what else is beside them
 * even. */
static void gs4i_reflect_forces(const gs4i_near_particles *near, int n, int with_mass,
                                const gs4i_forces *f)
{
    int b, c;
    gs4i_reflect_columns(near, n, f->x, f->y, f->z, 0);
    for (b = 0; b < n; b++) {
        gs4i_image_particle *g = gs4i_image_of(near, b);
        if (!g) continue;
        for (c = 0; c < 4; c++)
            g->carried[3][c] = g->part * (c < 3 || with_mass ? -1 : 1) * f->weight[4 * b + c];
        for (c = 0; c < 3; c++) g->carried[c][3] = 0;
    }
}

/* Affine momentum of the images of n particles: 2 m v - P(x), and its change from node to node,
 * that of 2 m v along the surface included. */
static void gs4i_reflect_affine(const gs4i_near_particles *near, int n, const gs4i_stencils *s,
                                const gs4i_affine_forces *f, gs4_real h)
{
    int b, c, a;
    gs4i_reflect_columns(near, n, f->x, f->y, f->z, 1);
    for (b = 0; b < n; b++) {
        gs4i_image_particle *g = gs4i_image_of(near, b);
        gs4_real turn[3][3];
        if (!g) continue;
        gs4i_surface_spin(g, turn);
        for (c = 0; c < 3; c++) {
            const gs4_real at_x = f->middle[4 * b + c]
                                  + f->x[4 * b + c] * GS4I_NTH_CONST(s->xi[0], b)
                                  + f->y[4 * b + c] * GS4I_NTH_CONST(s->xi[1], b)
                                  + f->z[4 * b + c] * GS4I_NTH_CONST(s->xi[2], b);
            g->carried[0][c] = 2 * g->x[3] * g->v[c] - g->part * at_x;
            for (a = 0; a < 3; a++) g->carried[1 + a][c] += 2 * g->x[3] * h * turn[a][c];
        }
    }
}

static void gs4i_free_image_particles(gs4i_memory *m, gs4i_image_particles *g)
{
    gs4i_patches *p = &g->patches;
    gs4i_scratch *const parts[14] = { &g->of_particles, &g->first_of, &g->all,   &g->of,
                                      &g->order,        &g->first,    &g->slots, &p->of,
                                      &p->all,          &p->distance, &p->nodes, &p->colliders,
                                      &p->blocks,       &p->surfaces };
    int i;
    for (i = 0; i < 14; i++) gs4i_free(m, parts[i]->data, parts[i]->bytes, 1);
    memset(g, 0, sizeof *g);
}

/* ==== [[explicit]] the explicit scheme: GS4 and symplectic Euler =============================== *
 *
 * A scheme turns what particles carry (mass, momentum, stress) and what nodes remember into an
 * acceleration and a stage velocity of the nodes. This one does so by forces alone. Its kernels in
 * the order of the step: S3 scatter momentum; S4, S5 gather gradients, ask the laws, scatter
 * forces; S6 nodes; S7 gather and correct. Symplectic Euler has one kernel each way. */

typedef struct gs4i_scheme {
    gs4_task_fn scatter, correct; /* kernels of S3 and S7 */
    gs4_task_fn remember;         /* what nodes keep of accelerations */
    /* before S3: room, and nothing on the nodes; after it: their velocities, with walls */
    int (*clear)(gs4_sim *sim, gs4i_node_pass *nodes);
    int (*set_velocities)(gs4_sim *sim, gs4i_node_pass *nodes);
    /* S4 to S6: acceleration and stage velocity of the nodes */
    int (*accelerate)(gs4_sim *sim, gs4i_node_pass *nodes);
    /* largest dt for waves of the speed c (m/s) and the kinematic viscosity nu (m^2/s) */
    double (*stable_dt)(const gs4_sim *sim, double c, double nu);
} gs4i_scheme;

/* --- nodes ------------------------------------------------------------------------------------ */

static void gs4i_clear_nodes(int index, void *context)
{
    const gs4_sim *sim = ((const gs4i_node_pass *)context)->sim;
    const gs4i_grid *g = &sim->grid;
    const int begin = index * GS4I_GROUP, end = gs4i_group_end(g, index);
    const size_t bytes = (size_t)(end - begin) * GS4I_NODE_REALS * sizeof(gs4_real);
    memset(gs4i_of_slot(g->momentum, begin), 0, bytes);
    memset(gs4i_of_slot(g->force, begin), 0, bytes);
    if (sim->particles.with_heat) memset(gs4i_of_slot(sim->conduction.heat_nodes, begin), 0, bytes);
    if (sim->conduction.heat_sources)
        memset(gs4i_of_slot(sim->conduction.heat_sources, begin), 0, bytes);
}

/* Jumps, and the flags of this step. */
static void gs4i_clear_jumps(int index, void *context)
{
    const gs4i_grid *g = &((const gs4i_node_pass *)context)->sim->grid;
    int s, i;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        uint8_t *flags = g->flags + gs4i_first_node(s);
        for (i = 0; i < GS4I_BLOCK_NODES; i++) flags[i] &= GS4I_LASTS;
        if (gs4i_has_jumps(g, s))
            memset(gs4i_jumps_of(g, s), 0, GS4I_NODE_REALS * sizeof(gs4_real));
    }
}

/* All colliders on the nodes of one block. What they take from the velocity at once is added to
 * the jumps where `jump` is given. At a sticky one the grid sees little of particles: in nodes
 * inside or held jumps have 1 as fourth number, by which sub-grid velocity decays (speeds before a
 * plate that slides 1.3 to 1.8 of its own; 1.9 to 6.9 without). */
static void gs4i_hold_nodes(const gs4_sim *sim, int slot, gs4_real *velocity,
                            gs4_real *acceleration, gs4_real *jump)
{
    const gs4i_grid *g = &sim->grid;
    gs4_real none[3], before[3];
    int first[3], x[3], b, i, c;
    if (!gs4i_has_jumps(g, slot)) return;
    gs4i_block_origin(g, g->block[slot], first);
    for (b = 0; b < sim->boundary.collider_count; b++) {
        const gs4i_collider *collider = &sim->boundary.colliders[b];
        const int sticky = gs4i_is_sticky(collider);
        if (collider->is_off || !gs4i_collider_is_near(collider, g, slot)) continue;
        for (i = 0; i < GS4I_BLOCK_NODES; i++) {
            const int imaged =
                sticky && (g->flags[gs4i_first_node(slot) + (uint32_t)i] & GS4I_IMAGED);
            gs4_real *v = velocity + 4 * i, d;
            gs4_vec3 p;
            if (!(v[3] > 0) || (imaged && !jump)) continue; /* no particle sees it */
            gs4i_node_coordinates(first, i, x);
            p = gs4i_place_position(g, x, GS4I_AT_CELL);
            d = gs4i_node_distance(sim, b, slot, i, p);
            if (sticky && jump && d < 0) jump[4 * i + 3] = 1;
            if (imaged || !gs4i_holds_node(&sim->boundary, g, collider, p, d)) continue;
            none[0] = none[1] = none[2] = 0;
            for (c = 0; c < 3; c++) before[c] = v[c];
            if (!gs4i_collider_hold(collider, p, g->h, &sim->integrator, v,
                                    acceleration ? acceleration + 4 * i : none))
                continue;
            for (c = 0; c < 3 && jump; c++) jump[4 * i + c] += v[c] - before[c];
            if (sticky && jump) jump[4 * i + 3] = 1;
        }
    }
}

/* v_i = (m v)_i / m_i, as bodies let it be. */
static void gs4i_node_velocities(int index, void *context)
{
    const gs4i_node_pass *pass = (const gs4i_node_pass *)context;
    const gs4i_grid *g = &pass->sim->grid;
    int s, i;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        gs4_real *q = gs4i_of_slot(g->momentum, s);
        for (i = 0; i < GS4I_NODE_REALS; i += 4) {
            const gs4_real m = q[i + 3];
            gs4i_quad v;
            GS4I_LOAD(v, q + i);
            GS4I_SPLAT_MUL(v, m > pass->lightest ? 1 / m : GS4I_C(0), v);
            GS4I_LANE(v, 3) = m;
            GS4I_STORE(q + i, v);
        }
        gs4i_hold_nodes(pass->sim, s, q, NULL, gs4i_jumps_of(g, s));
    }
}

/* What a node remembered before this step. A node that was empty takes ag_i = acc_i; where rates
 * start anew ag_i = 0, as the particles' are. */
GS4I_INLINE void gs4i_remembered_before(const gs4i_integrator *integrator, int flags,
                                        const gs4_real *ag, const gs4i_quad *acc, gs4i_quad *before)
{
    const gs4i_quad zero = { GS4I_LANES(0, 0, 0, 0) };
    if (integrator->restart)
        *before = zero;
    else if (flags & GS4I_REMEMBERS)
        GS4I_LOAD(*before, ag);
    else
        *before = *acc;
}

/* The share of s (acc_i - ag_i) that a node takes, smoothly from 0 where it is filled by less
 * than 10 % to 1 at 43 %: the acceleration of a nearly empty node is large, jumps when a
 * particle comes or goes, and would spoil the order in time (measured: order 1.2 to 1.6 of the
 * velocity without this, 1.9 to 2.0 with it). */
GS4I_INLINE gs4_real gs4i_node_weight(const gs4i_integrator *integrator, gs4_real filled)
{
    const gs4_real t = (filled - GS4I_C(0.1)) * 3;
    return integrator->restart || t >= 1 ? GS4I_C(1) : t <= 0 ? GS4I_C(0) : t * t * (3 - 2 * t);
}

/* S6: acc_i = f_i / m_i; u_i = v_i + s (acc_i - ag_i). Then colliders. */
static void gs4i_node_accelerations(int index, void *context)
{
    const gs4i_node_pass *pass = (const gs4i_node_pass *)context;
    const gs4i_grid *g = &pass->sim->grid;
    const gs4i_integrator *integrator = &pass->sim->integrator;
    int s, i;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        gs4_real *velocity = gs4i_of_slot(g->momentum, s), *force = gs4i_of_slot(g->force, s);
        const gs4_real *ag = gs4i_of_slot(g->remembered, s);
        const uint8_t *flags = g->flags + gs4i_first_node(s);
        for (i = 0; i < GS4I_NODE_REALS; i += 4) {
            const gs4_real m = velocity[i + 3], inverse = m > pass->lightest ? 1 / m : GS4I_C(0);
            const gs4_real weight =
                integrator->s * gs4i_node_weight(integrator, m * integrator->inv_node_mass);
            const gs4i_quad some = { GS4I_LANES(weight, weight, weight, 0) };
            gs4i_quad acc, before, u;
            GS4I_LOAD(acc, force + i);
            GS4I_LOAD(u, velocity + i);
            GS4I_SPLAT_MUL(acc, inverse, acc);
            GS4I_STORE(force + i, acc);
            gs4i_remembered_before(integrator, flags[i / 4], ag + i, &acc, &before);
            GS4I_DIFFERENCE(acc, acc, before);
            GS4I_MAD(u, some, acc);
            GS4I_STORE(velocity + i, u);
        }
        gs4i_hold_nodes(pass->sim, s, velocity, force, NULL);
    }
}

/* ag_i += (acc_i - ag_i) / alpha_m, once the step is certain: it belongs to the state. Mirror
 * nodes in contact have none. */
static void gs4i_remember_accelerations(int index, void *context)
{
    const gs4i_node_pass *pass = (const gs4i_node_pass *)context;
    const gs4i_grid *g = &pass->sim->grid;
    const gs4i_integrator *integrator = &pass->sim->integrator;
    int s, i;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        const gs4_real *velocity = gs4i_of_slot(gs4i_velocity(g), s),
                       *acceleration = gs4i_of_slot(gs4i_acceleration(g), s);
        gs4_real *ag = gs4i_of_slot(g->remembered, s);
        uint8_t *flags = g->flags + gs4i_first_node(s);
        for (i = 0; i < GS4I_NODE_REALS; i += 4, flags++) {
            const int there = velocity[i + 3] > pass->lightest && !(*flags & GS4I_FOLDS);
            gs4i_quad acc, before;
            GS4I_LOAD(acc, acceleration + i);
            gs4i_remembered_before(integrator, *flags, ag + i, &acc, &before);
            GS4I_DIFFERENCE(acc, acc, before);
            GS4I_SPLAT_MAD(before, integrator->inv_alpha_m, acc);
            GS4I_SPLAT_MUL(before, GS4I_C(there), before);
            GS4I_STORE(ag + i, before);
            ag[i + 3] = 0;
            *flags = (uint8_t)((*flags & ~GS4I_LASTS) | (there ? GS4I_REMEMBERS : 0)
                               | (*flags & GS4I_PRESSED ? GS4I_WAS_PRESSED : 0));
        }
    }
}

static void gs4i_find_fill_fractions(int index, void *context)
{
    const gs4_sim *sim = ((const gs4i_node_pass *)context)->sim;
    const gs4i_grid *g = &sim->grid;
    const size_t end = (size_t)GS4I_BLOCK_NODES * (size_t)gs4i_group_end(g, index);
    size_t i = (size_t)GS4I_BLOCK_NODES * (size_t)(index * GS4I_GROUP);
    for (; i < end; i++)
        g->fill_fraction[i] = gs4i_deconvolution_weight(g->momentum[4 * i + 3]
                                                        * sim->integrator.inv_densest_node_mass);
}

static void gs4i_deconvolve_velocities(int index, void *context)
{
    const gs4i_grid *g = &((const gs4i_node_pass *)context)->sim->grid;
    int s;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++)
        gs4i_deconvolve_block(g, s, g->momentum, 0);
}

/* Forces of stress, and the weight of what is on the nodes. */
static void gs4i_deconvolve_forces(int index, void *context)
{
    const gs4_sim *sim = ((const gs4i_node_pass *)context)->sim;
    const gs4i_grid *g = &sim->grid;
    const gs4i_quad gravity = { GS4I_LANES(sim->desc.gravity.x, sim->desc.gravity.y,
                                           sim->desc.gravity.z, 0) };
    int s, i;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        gs4_real *f = gs4i_of_slot(g->deconvolved, s);
        gs4i_deconvolve_block(g, s, g->force, 1);
        for (i = 0; i < GS4I_NODE_REALS; i += 4) {
            gs4i_quad sum;
            GS4I_LOAD(sum, f + i);
            GS4I_SPLAT_MAD(sum, f[i + 3], gravity);
            GS4I_STORE(f + i, sum);
        }
    }
}

/* S v_i or S u_i, mirror nodes included. */
static void gs4i_deconvolve(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_deconvolve_velocities, nodes);
    gs4i_fill_mirror_nodes(&sim->boundary, &sim->grid, sim->grid.deconvolved);
}

/* Nothing on the nodes yet; image particles where they are now. */
static int gs4i_clear_all_nodes(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_clear_nodes, nodes);
    return gs4i_find_image_particles(sim);
}

/* Velocities of the nodes, with walls and colliders; what contact took is left in the jumps. */
static int gs4i_set_velocities(gs4_sim *sim, gs4i_node_pass *nodes)
{
    const int groups = gs4i_groups(sim);
    if (gs4i_place_jumps(&sim->memory, &sim->boundary, &sim->grid) != GS4_OK)
        return gs4i_fail_memory(&sim->error);
    gs4i_parallel_for(&sim->tasks, groups, gs4i_clear_jumps, nodes);
    if (sim->image_particles.count) gs4i_scatter(sim, gs4i_mark_lacking_images);
    gs4i_scatter_image_particles(sim, sim->particles.with_rates && !sim->particles.deformation_reals
                                          ? gs4i_scatter_image_momentum
                                          : gs4i_scatter_image_affine);
    gs4i_fold_momentum(&sim->boundary, &sim->grid);
    gs4i_parallel_for(&sim->tasks, groups, gs4i_node_velocities, nodes);
    gs4i_fill_mirror_nodes(&sim->boundary, &sim->grid, sim->grid.momentum);
    if (sim->grid.with_deconvolution) {
        gs4i_parallel_for(&sim->tasks, groups, gs4i_find_fill_fractions, nodes);
        gs4i_fill_mirror_fractions(&sim->boundary, &sim->grid);
        gs4i_deconvolve(sim, nodes);
    }
    gs4i_gather_image_particles(sim, gs4i_gather_image_velocity);
    return GS4_OK;
}

/* The deconvolved forces become the forces. */
static void gs4i_copy_deconvolved(int index, void *context)
{
    const gs4i_grid *g = &((const gs4i_node_pass *)context)->sim->grid;
    const int begin = index * GS4I_GROUP, end = gs4i_group_end(g, index);
    memcpy(gs4i_of_slot(g->force, begin), gs4i_of_slot(g->deconvolved, begin),
           (size_t)(end - begin) * GS4I_NODE_REALS * sizeof(gs4_real));
}

/* S5 on nodes: forces of image particles, mirror nodes, deconvolution. */
static void gs4i_finish_forces(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_grid *g = &sim->grid;
    gs4i_parity parity[6];
    gs4i_scatter_image_particles(sim, gs4i_scatter_image_force);
    gs4i_fold_force(&sim->boundary, g, sim->integrator.dt);
    if (!g->with_deconvolution) return;
    gs4i_fill_mirror_nodes(&sim->boundary, g, g->force);
    gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_deconvolve_forces, nodes);
    gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_copy_deconvolved, nodes);
    gs4i_weigh_mirror_nodes(&sim->boundary, g, sim->desc.gravity);
    gs4i_vector_parity(&sim->boundary, 3, parity);
    gs4i_fold(&sim->boundary, g, g->force, parity);
}

/* --- S3 --------------------------------------------------------------------------------------- */

/* Solids turn about their particles too: m v~ + m w~ x (x_i - x~) for particles i to i + n. 0
 * where none of them turns. */
static int gs4i_spin_momentum(const gs4_sim *sim, size_t i, int n, const gs4i_stencils *s,
                              const gs4i_wide *mass, gs4i_lanes mv[3], gs4i_affine_forces *f)
{
    const gs4i_particles *p = &sim->particles;
    const gs4i_integrator *integrator = &sim->integrator;
    gs4_real own[4 * GS4I_BATCH], any = 0;
    gs4i_lanes w[4], bound;
    gs4i_gradient Q;
    int a, b, c;
    for (b = 0; b < n; b++) {
        const gs4_real *spin = p->deformation + (size_t)p->deformation_reals * (i + (size_t)b) + 18;
        for (a = 0; a < 3; a++) {
            own[4 * b + a] = spin[a] + integrator->prediction.ahead * spin[a + 3];
            any += gs4i_abs(own[4 * b + a]);
        }
        own[4 * b + 3] = 0;
    }
    if (!(any > 0)) return 0;
    gs4i_to_lanes(own, n, w);
    memset(Q, 0, sizeof Q);
    /* w x r as a matrix: Q_ji = w_k, Q_ij = -w_k for i, j, k in turn */
    for (c = 0; c < 3; c++) {
        const int j = (c + 1) % 3, k = (c + 2) % 3;
        GS4I_BATCH_LOOP(b) {
            Q[j][c][b] = w[k][b];
            Q[c][j][b] = -w[k][b];
        }
    }
    gs4i_affine_bound(Q, integrator->dt, bound);
    for (a = 0; a < 9; a++)
        GS4I_BATCH_LOOP(b) Q[a / 3][a % 3][b] *= bound[b] * (sim->grid.h * mass[b]);
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b)
            mv[c][b] -=
                Q[c][0][b] * s->xi[0][b] + Q[c][1][b] * s->xi[1][b] + Q[c][2][b] * s->xi[2][b];
    gs4i_from_lanes(mv[0], mv[1], mv[2], mass, f->middle);
    gs4i_from_lanes(Q[0][0], Q[1][0], Q[2][0], w[3], f->x);
    gs4i_from_lanes(Q[0][1], Q[1][1], Q[2][1], w[3], f->y);
    gs4i_from_lanes(Q[0][2], Q[1][2], Q[2][2], w[3], f->z);
    return 1;
}

/* S3: m_i = sum w m, m_i v_i = sum w m v~ with v~ = v + alpha_f dt a. */
static void gs4i_scatter_momentum(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    const gs4i_particles p = sim->particles; /* a copy: stores cannot alias it */
    const gs4i_prediction prediction = sim->integrator.prediction;
    const int o = pass->blocks[index];
    const gs4i_frame frame = gs4i_tile_frame(&sim->grid, sim->grid.occupied_block[o]);
    gs4_real tile[GS4I_TILE_REALS];
    int row = 0;
    size_t i = (size_t)sim->grid.first[o], end = (size_t)sim->grid.first[o + 1];
    int left_tile = 0;
    uint64_t rows = 0;
    gs4i_report_clear(&sim->reports[o]);
    memset(tile, 0, sizeof tile);
    for (; i < end; i += GS4I_BATCH, row += 2) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s;
        gs4i_lanes mv[3];
        gs4_real momentum[4 * GS4I_BATCH];
        gs4i_affine_forces spin;
        int b, c, turns;
        gs4i_tile_prefetch(&sim->grid, o, row, sim->grid.momentum);
        gs4i_stage_batch(&p, i, n, prediction, &frame, &q, &s);
        for (c = 0; c < 3; c++)
            GS4I_BATCH_LOOP(b) mv[c][b] = q.x[3][b] * (q.v[c][b] + prediction.ahead * q.a[c][b]);
        gs4i_from_lanes(mv[0], mv[1], mv[2], q.x[3], momentum);
        turns = p.deformation_reals && gs4i_spin_momentum(sim, i, n, &s, q.x[3], mv, &spin);
        for (b = 0; b < n; b++) {
            if (s.base[b] < 0) {
                left_tile++;
                continue;
            }
            rows |= gs4i_touched_rows(s.base[b]);
            if (turns)
                gs4i_scatter_affine(tile, &s, b, &spin);
            else
                gs4i_scatter_quad(tile, &s, b, momentum + 4 * b);
        }
    }
    sim->reports[o].left_tile = left_tile;
    sim->reports[o].rows = rows;
    gs4i_tile_add(&sim->grid, o, rows, tile, sim->grid.momentum);
}

/* How particles turn, by the velocities of the nodes: see gs4i_find_spin. */
static void gs4i_find_spin_task(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    const gs4i_particles p = sim->particles;
    const int o = pass->blocks[index];
    const gs4i_frame frame = gs4i_tile_frame(&sim->grid, sim->grid.occupied_block[o]);
    gs4_real nodes[GS4I_TILE_REALS];
    size_t i = (size_t)sim->grid.first[o], end = (size_t)sim->grid.first[o + 1];
    gs4i_tile_load(&sim->grid, o, sim->reports[o].rows, sim->grid.momentum, nodes);
    for (; i < end; i += GS4I_BATCH) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s;
        gs4i_gathered v;
        int b;
        gs4i_stage_batch(&p, i, n, sim->integrator.prediction, &frame, &q, &s);
        for (b = 0; b < n; b++) {
            gs4i_row w, d;
            if (!(gs4i_constants_of(sim, i + (size_t)b)->shear_modulus > 0)) continue;
            gs4i_x_weights(&s, b, &w, &d);
            gs4i_gather_local(nodes + 4 * s.base[b], &s, b, &w, &d, &v);
            gs4i_set_spin(
                &p, i + (size_t)b,
                gs4i_scale(gs4i_vec3(v.dy[4 * b + 2] - v.dz[4 * b + 1],
                                     v.dz[4 * b] - v.dx[4 * b + 2], v.dx[4 * b + 1] - v.dy[4 * b]),
                           GS4I_C(0.5)));
        }
    }
}

/* --- S4, S5 ----------------------------------------------------------------------------------- */

GS4I_INLINE void gs4i_prefetch_subgrid(const gs4i_particles *p, size_t i)
{
    int b;
    for (b = 0; b < 4 * GS4I_BATCH && i < (size_t)p->count; b += 16)
        GS4I_PREFETCH(p->subgrid + 4 * i + b);
}

/* V - v~ of n particles, V = sum w v_i; and, where noise decays by itself, how much faster: with
 * `sticks` by what is beside V more. */
GS4I_INLINE void gs4i_subgrid_of(const gs4i_integrator *r, const gs4i_batch *q, int sticks,
                                 gs4i_lanes subgrid[4])
{
    gs4i_lanes noise;
    int b, c;
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b) subgrid[c][b] -= q->v[c][b] + r->prediction.ahead * q->a[c][b];
    memset(noise, 0, sizeof noise);
    if (r->crossing > 0) {
        for (c = 0; c < 3; c++)
            GS4I_BATCH_LOOP(b) noise[b] += subgrid[c][b] * subgrid[c][b];
        for (b = 0; b < GS4I_BATCH; b++)
            GS4I_NTH(noise, b) = r->crossing * GS4I_SQRT(GS4I_NTH(noise, b));
        if (sticks)
            GS4I_BATCH_LOOP(b) noise[b] += subgrid[3][b];
        GS4I_BATCH_LOOP(b) gs4i_faster(r, r->decay, r->stable_decay, &noise[b]);
    }
    memcpy(subgrid[3], noise, sizeof noise);
}

/* V - v~ of n particles, of which V = sum w v_i was gathered. Their momenta sum up to none. Fourth
 * number: how much faster than others they decay as noise, |V - v~|/h (1/s). */
GS4I_INLINE void gs4i_find_subgrid(const gs4i_particles *p, size_t i, int n,
                                   const gs4i_integrator *r, const gs4i_batch *q, int sticks,
                                   const gs4_real *V, gs4i_lanes subgrid[4])
{
    gs4_real out[4 * GS4I_BATCH];
    gs4i_to_lanes(V, n, subgrid);
    gs4i_subgrid_of(r, q, sticks, subgrid);
    gs4i_from_lanes(subgrid[0], subgrid[1], subgrid[2], subgrid[3], out);
    gs4i_prefetch_subgrid(p, i + 4 * GS4I_BATCH);
    memcpy(p->subgrid + 4 * i, out, 4 * (size_t)n * sizeof *out);
}

/* What is not stress among the forces of a batch: m g, and what noise leaves behind that decays at
 * a rate k of its own, - m k (V - v~). So it takes no momentum; and next to nothing of motion that
 * the grid does see, since that part of V - v~ is smooth and comes back to the particles. Beside
 * them, with deconvolution, the mass instead of m g; else m (rho0 c0^2 / 7) (J~ - 1), so that the
 * grid sees J. */
GS4I_INLINE void gs4i_weigh_batch(const gs4i_response *r, const gs4i_batch *q,
                                  const gs4_vec3 *gravity, gs4i_lanes subgrid[4], gs4i_forces *f)
{
    const gs4i_integrator *integrator = r->integrator;
    gs4i_lanes pull[4];
    int b, c;
    memset(pull, 0, sizeof pull);
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide m = q->x[3][b];
        if (!gravity)
            pull[3][b] = m;
        else {
            pull[0][b] = m * gravity->x;
            pull[1][b] = m * gravity->y;
            pull[2][b] = m * gravity->z;
        }
        for (c = 0; c < 3 && integrator->crossing > 0; c++)
            pull[c][b] -= m * (subgrid[3][b] * subgrid[c][b]);
        if (integrator->volume_crossing > 0)
            pull[3][b] = m
                         * (r->constants.tait[b]
                            * (q->v[3][b] + integrator->prediction.ahead * q->a[3][b] - GS4I_C(1)));
    }
    gs4i_from_lanes(pull[0], pull[1], pull[2], pull[3], f->weight);
}

/* Volume and stress at the stage, J~ by (4), implicit in itself for known div v: (J~ - J**) / s =
 * J~ div v. Then forces -V sigma. */
GS4I_INLINE void gs4i_stage_forces(gs4i_response *r, const gs4i_batch *q, gs4i_gradient L,
                                   gs4i_forces *f)
{
    gs4i_symmetric sigma;
    gs4i_lanes J, mu, none;
    int b, c;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide div = L[0][0][b] + L[1][1][b] + L[2][2][b];
        J[b] = (q->v[3][b] + r->integrator->before * q->a[3][b] + r->integrator->s * q->fades[b])
               / (GS4I_C(1) - r->integrator->s * div);
    }
    gs4i_stress(r, L, J, sigma, mu);
    gs4i_check_liquids(r->report, J, mu, r->p->id + r->i, r->n);
    if (r->heat) gs4i_heat_of_stress(r, q->x[3], J, L, sigma);
    for (c = 0; c < 6; c++)
        GS4I_BATCH_LOOP(b) sigma[c][b] *= -q->x[3][b] * r->constants.inv_density[b] * J[b];
    memset(none, 0, sizeof none);
    gs4i_from_lanes(sigma[0], sigma[3], sigma[4], none, f->x);
    gs4i_from_lanes(sigma[3], sigma[1], sigma[5], none, f->y);
    gs4i_from_lanes(sigma[4], sigma[5], sigma[2], none, f->z);
}

/* v and its gradient from nodes; with deconvolution v from plain ones. */
GS4I_INLINE void gs4i_gather_stage(const gs4_real *nodes, const gs4_real *plain,
                                   const gs4i_stencils *s, int n, gs4i_gathered *v)
{
    int b;
    for (b = 0; b < n; b++) {
        gs4i_row w, d;
        gs4i_x_weights(s, b, &w, &d);
        gs4i_gather_local(nodes + 4 * s->base[b], s, b, &w, &d, v);
        if (plain) gs4i_gather_value(plain + 4 * s->base[b], s, b, &w, v->value);
    }
}

/* S4 and S5: L~ = sum v_i (x) grad w, J~ and stress there, and f_i = - sum V sigma grad w + sum
 * w m g. With deconvolution nodes weigh what is on them: gs4i_deconvolve_forces. */
static void gs4i_scatter_stage(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    const gs4i_grid *g = &sim->grid;
    const gs4i_particles p = sim->particles;
    gs4i_heat_pass heat_pass, *heat = p.with_heat ? &heat_pass : NULL;
    const gs4i_integrator integrator = sim->integrator;
    const int o = pass->blocks[index], next = gs4i_next_block(pass, index);
    const gs4i_frame frame = gs4i_tile_frame(g, g->occupied_block[o]);
    const gs4_vec3 *gravity = g->with_deconvolution ? NULL : &sim->desc.gravity;
    const int with_plain = g->with_deconvolution && p.with_subgrid;
    gs4i_report *report = &sim->reports[o];
    gs4i_response r;
    gs4_real nodes[GS4I_TILE_REALS], plain[GS4I_TILE_REALS], tile[GS4I_TILE_REALS];
    gs4i_near_particles near = gs4i_near_particles_of(sim, o);
    int row = 0, sticks;
    size_t i = (size_t)g->first[o], end = (size_t)g->first[o + 1];
    gs4i_tile_load(g, o, report->rows, gs4i_gradient_velocity(g), nodes);
    if (with_plain) gs4i_tile_load(g, o, report->rows, gs4i_velocity(g), plain);
    sticks = integrator.crossing > 0
             && gs4i_load_near_decay(sim, o, report->rows, with_plain ? plain : nodes);
    memset(tile, 0, sizeof tile);
    gs4i_begin_response(&r, sim, &p, &integrator, report, heat);
    if (heat) gs4i_clear_heat_tiles(heat);
    for (; i < end; i += GS4I_BATCH, row += 2) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s;
        gs4i_gathered v;
        gs4i_gradient L;
        gs4i_lanes subgrid[4];
        gs4i_forces f;
        int b;
        gs4i_tile_prefetch(g, next, row, gs4i_gradient_velocity(g));
        gs4i_tile_prefetch(g, o, row, g->force);
        gs4i_stage_batch(&p, i, n, integrator.prediction, &frame, &q, &s);
        gs4i_gather_stage(nodes, with_plain ? plain : NULL, &s, n, &v);
        if (near.particle) gs4i_make_odd(&near, n, 0, &v, NULL);
        if (p.with_subgrid)
            gs4i_find_subgrid(&p, i, n, &integrator, &q, sticks, v.value, subgrid);
        else
            memset(subgrid, 0, sizeof subgrid);
        gs4i_gradient_lanes(v.dx, v.dy, v.dz, n, L);
        gs4i_turn_to_batch(&r, i, n);
        if (heat) gs4i_load_batch_heat(&r);
        gs4i_stage_forces(&r, &q, L, &f);
        gs4i_weigh_batch(&r, &q, gravity, subgrid, &f);
        for (b = 0; b < n; b++) gs4i_scatter_force(tile, &s, b, &f);
        if (near.particle) {
            gs4i_reflect_forces(&near, n, !gravity, &f);
            near.particle += n;
        }
        if (heat) gs4i_scatter_heat(sim, heat, &s, n);
    }
    gs4i_report_liquids(report, &r.seen);
    gs4i_tile_add(g, o, report->rows, tile, g->force);
    if (heat) gs4i_add_heat(sim, o, heat);
}

/* --- S7 --------------------------------------------------------------------------------------- */

/* How little the grid sees of a particle among few others, by how full its nodes are: 1 below 8
 * %, smoothly to 0 at 20 %. What it does not see of such spray would swing ever more (nodes this
 * light take no part in the corrected gradient), so there it fades at the rate c0 / h; so it
 * does at walls, by the weight of the images. Both are rates: dt does not matter. */
GS4I_INLINE void gs4i_decay_weight(const gs4i_wide *filled, gs4i_wide *weight)
{
    const gs4i_wide zero = *filled - *filled, one = zero + GS4I_C(1);
    gs4i_wide t = (*filled - GS4I_C(0.08)) * GS4I_C(1 / 0.12);
    GS4I_WIDE_MIN(t, t, one);
    GS4I_WIDE_MAX(t, t, zero);
    *weight = one - t * t * (GS4I_C(3) - GS4I_C(2) * t);
}

/* What nodes and contact say to a batch in S7, from whichever grid it was gathered. */
typedef struct gs4i_corrections {
    gs4i_lanes U[4];           /* sum w u_i, and of the mass of the nodes */
    gs4i_lanes A[4];           /* sum w acc_i */
    gs4i_lanes jump[4];        /* velocity by contact, and the weight of mirror nodes in contact */
    gs4i_lanes subgrid[4];     /* V - v~; how much faster it decays as noise */
    gs4i_lanes volume;         /* of J - 1, what the grid sees */
    gs4i_gradient L;           /* sum u_i (x) grad w */
    gs4i_gathered_rates rates; /* for solids */
} gs4i_corrections;

/* Decay of what the grid does not see of J, at the rate of the sub-grid velocity, whose source it
 * is: as pressure that pushes particles hither and thither. It adds c0 over h times itself to that
 * rate. */
GS4I_INLINE void gs4i_volume_decay(const gs4i_integrator *r, const gs4i_corrections *k,
                                   gs4i_batch *q)
{
    int b;
    memset(q->fades, 0, sizeof q->fades); /* or what was of the last step would stay */
    if (!(r->volume_crossing > 0)) return;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide subgrid =
            k->volume[b] - (q->v[3][b] + r->prediction.ahead * q->a[3][b] - GS4I_C(1));
        const gs4i_wide none = subgrid - subgrid;
        gs4i_wide rate;
        GS4I_WIDE_MAX(rate, subgrid, -subgrid);
        rate = r->volume_crossing * rate - r->weight_crossing;
        GS4I_WIDE_MAX(rate, rate, none);
        rate += k->subgrid[3][b];
        gs4i_faster(r, 0, 0, &rate);
        q->fades[b] = rate * subgrid;
    }
}

/* What contact with sticky bodies gives a particle takes it no farther than to what the grid sees,
 * V: of the jump j it takes max(0, min(1, j.r/r.r)) r, r = V - v~, which is j where there was no
 * sub-grid velocity. Held nodes have what liquid before them lacks as jump again and again, and
 * particles beside a body that have its velocity took that too: 1.5 times the speed of the rim of a
 * paddle (sub-grid 0.7), now 0.96. */
GS4I_INLINE void gs4i_limit_jumps(gs4i_corrections *k)
{
    int b, c;
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide none = k->jump[0][b] - k->jump[0][b], one = none + GS4I_C(1);
        gs4i_wide along = none, square = none + GS4I_TINY;
        for (c = 0; c < 3; c++) {
            along += k->jump[c][b] * k->subgrid[c][b];
            square += k->subgrid[c][b] * k->subgrid[c][b];
        }
        along = along / square;
        GS4I_WIDE_MIN(along, along, one);
        GS4I_WIDE_MAX(along, along, none);
        for (c = 0; c < 3; c++) k->jump[c][b] = along * k->subgrid[c][b];
    }
}

/* What material that lies too densely adds to dJ/dt: with f = sum w m_i / (rho0 h^3) how densely
 * the grid holds it, J f > 1.08 says that it fills more than the space there. Then J goes to
 * 1.08/f, by 1/200 (chosen) of the way while sound crosses a cell, and pressure does the rest. It
 * goes to 0.9 at least, where pressure is 0.16 rho0 c0^2: what has no room to go to is not to
 * burst. Surfaces, films and spray have less f, what is compressed has less J. Lattices a cell
 * apart, as coarse as fillings may be, have f up to 1.03; with 1.03 as the bound tanks swell by
 * 4 %. */
#define GS4I_PACKED 1.08
#define GS4I_MOST_UNPACKED 0.9

GS4I_INLINE void gs4i_unpack(const gs4i_integrator *r, const gs4i_wide *mass, const gs4i_wide *J,
                             gs4i_wide *rate)
{
    const gs4i_wide zero = *J - *J;
    gs4i_wide room = *mass * r->inv_node_mass + GS4I_TINY;
    room = (zero + GS4I_C(GS4I_PACKED)) / room;
    GS4I_WIDE_MAX(room, room, zero + GS4I_C(GS4I_MOST_UNPACKED));
    room = room - *J;
    GS4I_WIDE_MIN(room, room, zero);
    *rate = r->unpacking * room;
}

/* S7. Velocity by rule (4), motion that the grid cannot see decays: v~ - V at its rate, see
 * gs4i_find_subgrid, in spray and at walls v - U faster, implicit in itself; J by 2021 (57),
 * implicit in J for known div u; position by rule (4) with the grid's velocity U. In: move is
 * dx/dt; out: what the new dx/dt lags behind v - shift a. */
GS4I_INLINE void gs4i_correct_batch(gs4i_integrator r, const gs4i_corrections *k, gs4i_batch *q)
{
    gs4i_lanes decay, damped;
    int b, c;
    gs4i_volume_decay(&r, k, q);
    if (r.unpacking > 0)
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide J = q->v[3][b] + r.prediction.ahead * q->a[3][b];
            gs4i_wide rate;
            gs4i_unpack(&r, &k->U[3][b], &J, &rate);
            q->fades[b] += rate;
        }
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide filled = k->U[3][b] * r.inv_node_mass;
        gs4i_wide weight;
        gs4i_decay_weight(&filled, &weight);
        decay[b] = (weight + k->jump[3][b]) * r.fast_decay;
        damped[b] = GS4I_C(1) / (GS4I_C(1) + r.s * decay[b]);
    }
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide v = q->v[c][b], a = q->a[c][b], move = q->move[c][b] + k->jump[c][b];
            const gs4i_wide stage_a =
                (k->A[c][b] + (r.stable_decay + k->subgrid[3][b]) * k->subgrid[c][b]
                 + decay[b] * (k->U[c][b] - (v + r.before * a)))
                * damped[b];
            const gs4i_wide da = (stage_a - a) * r.inv_alpha_m,
                            change = (k->U[c][b] - move) * r.inv_alpha_m;
            q->v[c][b] = ((v + r.dt * a) + r.gamma * r.dt * da) + k->jump[c][b];
            q->a[c][b] = a + da;
            if (r.decayed_at_once > 0) q->v[c][b] += r.decayed_at_once * k->subgrid[c][b];
            q->x[c][b] = (q->x[c][b] + r.dt * move) + r.gamma * r.dt * change;
            q->move[c][b] = (q->v[c][b] - (move + change)) - r.next_shift * q->a[c][b];
        }
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide J = q->v[3][b], Jr = q->a[3][b],
                        div = k->L[0][0][b] + k->L[1][1][b] + k->L[2][2][b];
        const gs4i_wide dJ = ((J + r.prediction.ahead * Jr) * div + q->fades[b] - Jr)
                             / (r.alpha_m - r.alpha_f * r.gamma * r.dt * div);
        q->v[3][b] = (J + r.dt * Jr) + r.gamma * r.dt * dJ;
        q->a[3][b] = Jr + dJ;
    }
}

/* A batch as it goes back to memory: four numbers a particle, four halves of the lag. */
typedef struct gs4i_stored {
    gs4_real x[4 * GS4I_BATCH], v[4 * GS4I_BATCH], a[4 * GS4I_BATCH];
    gs4i_half position_residual[4 * GS4I_BATCH];
} gs4i_stored;

GS4I_INLINE void gs4i_pack_batch(const gs4i_batch *q, int with_rates, gs4i_stored *o)
{
    gs4_real position_residual[4 * GS4I_BATCH];
    int e;
    gs4i_from_lanes(q->x[0], q->x[1], q->x[2], q->x[3], o->x);
    gs4i_from_lanes(q->v[0], q->v[1], q->v[2], q->v[3], o->v);
    if (!with_rates) return;
    gs4i_from_lanes(q->a[0], q->a[1], q->a[2], q->a[3], o->a);
    gs4i_from_lanes(q->move[0], q->move[1], q->move[2], q->fades, position_residual);
    for (e = 0; e < 4 * GS4I_BATCH; e++)
        o->position_residual[e] = gs4i_to_half(position_residual[e]);
}

GS4I_INLINE void gs4i_store_batch(const gs4i_particles *p, size_t i, int n, const gs4i_stored *o)
{
    memcpy(p->position + 4 * i, o->x, 4 * (size_t)n * sizeof *o->x);
    memcpy(p->velocity + 4 * i, o->v, 4 * (size_t)n * sizeof *o->v);
    if (!p->with_rates) return;
    memcpy(p->rate + 4 * i, o->a, 4 * (size_t)n * sizeof *o->a);
    memcpy(p->position_residual + 4 * i, o->position_residual,
           4 * (size_t)n * sizeof *o->position_residual);
}

/* Does a body put back particles that are inside of it? Sticky ones are left out where image
 * particles know of them. */
GS4I_INLINE int gs4i_touches(const gs4i_collider *b, int with_sticky)
{
    return !b->is_off && (with_sticky || !gs4i_is_sticky(b));
}

/* Is any of n positions inside of a body, or may be? By the ball around their box. */
static int gs4i_may_touch(const gs4i_boundary *b, const gs4_real *x, int n, gs4_real h,
                          int with_sticky)
{
    gs4_real low[3], high[3], prediction;
    gs4_vec3 midst;
    int i, a;
    for (i = 0; i < b->collider_count && !gs4i_touches(&b->colliders[i], with_sticky);) i++;
    if (i == b->collider_count) return 0;
    for (a = 0; a < 3; a++) {
        for (low[a] = high[a] = x[a], i = 1; i < n; i++) {
            low[a] = gs4i_min(low[a], x[4 * i + a]);
            high[a] = gs4i_max(high[a], x[4 * i + a]);
        }
        low[a] *= GS4I_C(0.5);
        high[a] *= GS4I_C(0.5);
    }
    midst = gs4i_vec3(low[0] + high[0], low[1] + high[1], low[2] + high[2]);
    prediction = gs4i_length(gs4i_vec3(high[0] - low[0], high[1] - low[1], high[2] - low[2]))
                 + GS4I_C(0.1) * h;
    for (i = 0; i < b->collider_count; i++)
        if (gs4i_touches(&b->colliders[i], with_sticky)
            && !(gs4i_collider_distance(&b->colliders[i], midst) > prediction))
            return 1;
    return 0;
}

/* Are sixteen positions in the domain, of which n are in use? */
GS4I_INLINE int gs4i_are_in_domain(const gs4i_grid *g, const gs4_real *x, int n)
{
    const gs4_real low[3] = { g->origin.x, g->origin.y, g->origin.z };
    gs4i_lanes at[4];
    int a, b, all = 1;
    gs4i_to_lanes(x, n, at);
    for (a = 0; a < 3; a++) {
        const gs4_real high = low[a] + GS4I_C(g->cells[a]) * g->h;
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide_mask in = (at[a][b] >= low[a]) & (at[a][b] < high);
            all &= gs4i_all(&in);
        }
    }
    return all;
}

/* Walls, colliders and emitters on each particle after the step. `clear`: see
 * gs4i_find_clear_nodes, NULL where no body is sticky or image particles do not know of them. */
static void gs4i_correct_contact(gs4_sim *sim, int block, const uint64_t *clear, size_t i, int n,
                                 gs4i_stored *o, gs4i_gathered *L, gs4i_report *report)
{
    gs4_real *elastic = sim->particles.elastic_reals
                            ? sim->particles.elastic + (size_t)sim->particles.elastic_reals * i
                            : NULL;
    const int touches =
        gs4i_may_touch(&sim->boundary, o->x, n, sim->grid.h, sim->desc.scheme != GS4_EXPLICIT);
    const unsigned inside = clear ? gs4i_ended_inside(sim, block, clear, o->x, n) : 0;
    int b;
    if (!touches && !inside && gs4i_are_in_domain(&sim->grid, o->x, n)) return;
    for (b = 0; b < n; b++) {
        const gs4i_collider *emitter;
        if (!touches && !(inside >> b & 1) && gs4i_is_in_domain(&sim->grid, o->x + 4 * b)) continue;
        gs4i_put_back(&sim->boundary, &sim->grid, o->x + 4 * b, o->v + 4 * b);
        emitter = gs4i_hold_in_emitter(&sim->boundary, o->x + 4 * b, o->v + 4 * b);
        if (emitter) {
            memset(o->a + 4 * b, 0, 4 * sizeof *o->a);
            memset(o->position_residual + 4 * b, 0, 4 * sizeof *o->position_residual);
            memset(L->dx + 4 * b, 0, 4 * sizeof *L->dx);
            memset(L->dy + 4 * b, 0, 4 * sizeof *L->dy);
            memset(L->dz + 4 * b, 0, 4 * sizeof *L->dz);
            if (sim->particles.with_heat)
                gs4i_begin_heat(&sim->particles, i + (size_t)b,
                                &sim->constants[sim->particles.material[i + (size_t)b]],
                                emitter->is.temperature);
            if (sim->particles.deformation_reals) gs4i_undeform(&sim->particles, i + (size_t)b, 1);
            if (elastic)
                memset(elastic + (size_t)sim->particles.elastic_reals * (size_t)b, 0,
                       (size_t)sim->particles.elastic_reals * sizeof *elastic);
        }
        report->left += !gs4i_is_in_domain(&sim->grid, o->x + 4 * b);
    }
}

/* Is the result one that may be kept? Moved at most two cells, all finite, J in its range. */
static void gs4i_validate_batch(gs4i_batch *q, gs4i_gradient L, const gs4_real *old_x, int n,
                                gs4_real h, const uint32_t *id, gs4i_report *report)
{
    int b, i, j;
    for (b = 0; b < n; b++) {
        gs4_real moved = 0, all = 0;
        for (i = 0; i < 3; i++) {
            const gs4_real d = GS4I_NTH(q->x[i], b) - old_x[4 * b + i], v = GS4I_NTH(q->v[i], b);
            moved += d * d;
            all += v * v + GS4I_NTH(q->a[i], b);
            for (j = 0; j < 3; j++) all += GS4I_NTH(L[i][j], b) * GS4I_NTH(L[i][j], b);
        }
        if (!(GS4I_NTH(q->v[3], b) > GS4I_J_LOW && GS4I_NTH(q->v[3], b) < GS4I_J_HIGH
              && gs4i_finite(GS4I_NTH(q->a[3], b))))
            gs4i_see_bad(report, GS4I_BAD_VOLUME, id[b]);
        if (!(gs4i_finite(all) && moved <= 4 * h * h)) gs4i_see_bad(report, GS4I_BAD_MOTION, id[b]);
    }
}

/* --- can S7 be trusted? ------------------------------------------------------------------------ *
 *
 * The lemma of the manual: see SAFETY there. A block whose nodes satisfy it needs no trial pass. */

/* h |div u| over the spread of velocities: 2 by full nodes, 27 sqrt(2)/14 by light ones */
#define GS4I_DIVERGENCE_BOUND 4.7
/* nodes lighter than the lightest particle over 196 = 14^2 count by 14 sqrt(m_i/m_min) */
#define GS4I_LIGHT_NODE 14

/* Mean velocity of the nodes of each block, and max_i q_i |u_i - mean|_1 with q of gs4i_is_safe;
 * -1 where there is no material. */
static void gs4i_node_spreads(int index, void *context)
{
    const gs4i_node_pass *pass = (const gs4i_node_pass *)context;
    const gs4i_grid *g = &pass->sim->grid;
    const gs4_real light = pass->sim->min_mass * GS4I_C(1.0 / (GS4I_LIGHT_NODE * GS4I_LIGHT_NODE));
    const gs4i_quad zero = { GS4I_LANES(0, 0, 0, 0) };
    int s, i;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        const gs4_real *u = gs4i_of_slot(gs4i_gradient_velocity(g), s);
        gs4i_quad sum = zero, worst = zero, total = zero, q;
        gs4_real mass = 0, *spread = g->spread + 4 * (size_t)s;
        for (i = 0; i < 4 * GS4I_BLOCK_NODES; i += 4) {
            GS4I_LOAD(q, u + i);
            GS4I_SPLAT_MAD(sum, u[i + 3], q);
            mass += u[i + 3];
        }
        GS4I_SPLAT_MUL(sum, mass > 0 ? 1 / mass : GS4I_C(0), sum);
        for (i = 0; i < 4 * GS4I_BLOCK_NODES; i += 4) {
            if (!(u[i + 3] > 0)) continue;
            GS4I_LOAD(q, u + i);
            GS4I_DIFFERENCE(q, q, sum);
            if (u[i + 3] <= light)
                GS4I_SPLAT_MUL(q, GS4I_LIGHT_NODE * GS4I_SQRT(u[i + 3] / pass->sim->min_mass), q);
            GS4I_MUL(q, q, q);
            GS4I_GREATER(worst, q, worst);
            /* the greatest loses NaN, the sum does not */
            GS4I_SUM(total, total, q);
        }
        GS4I_STORE(spread, sum);
        spread[3] = !(mass > 0) ? GS4I_C(-1)
                    : !gs4i_finite(GS4I_LANE(total, 0) + GS4I_LANE(total, 1) + GS4I_LANE(total, 2))
                        ? GS4I_HUGE
                        : GS4I_SQRT(GS4I_LANE(worst, 0)) + GS4I_SQRT(GS4I_LANE(worst, 1))
                              + GS4I_SQRT(GS4I_LANE(worst, 2));
    }
}

/* Can the nodes around a block alone prove that S7 is safe for its particles? A node of mass m_i
 * has weight at most m_i/m_p and gradient at most sqrt(2 m_i/m_p)/h in any particle p, so with
 * q_i = min(1, 14 sqrt(m_i/m_min)) and any velocity r no particle sees |div u| > 4.7/h max_i q_i
 * |u_i - r|_1; `spread` has that maximum about a block's own mean (gs4i_node_spreads). */
static int gs4i_is_safe(const gs4i_pass *pass, int index)
{
    const gs4_sim *sim = pass->sim;
    const gs4i_grid *g = &sim->grid;
    const int o = pass->blocks[index];
    const int32_t *nb = g->neighbour + 27 * (size_t)o;
    const gs4i_report *report = &sim->reports[o];
    const gs4_real *mean = g->spread + 4 * (size_t)nb[13],
                   limit =
                       GS4I_C(GS4I_SAFE_STRAIN / GS4I_DIVERGENCE_BOUND) * g->h / sim->integrator.dt;
    int i, c;
    if (!(report->min_J > GS4I_C(0.25) && report->max_J < 4) || report->hard
        || !gs4i_images_are_safe(sim, o))
        return 0;
    for (c = 0; c < 3; c++)
        if (!(gs4i_abs(mean[c]) * sim->integrator.dt < g->h)) return 0;
    for (i = 0; i < 27; i++) {
        const gs4_real *of = g->spread + 4 * (size_t)nb[i];
        gs4_real all = of[3];
        if (all < 0) continue; /* no material there */
        for (c = 0; c < 3; c++) all += gs4i_abs(of[c] - mean[c]);
        if (!(all < limit)) return 0;
    }
    return 1;
}

/* --- gather and correct ----------------------------------------------------------------------- */

/* The tiles that S7 reads of one block. */
typedef struct gs4i_correction_tiles {
    gs4_real velocity[GS4I_TILE_REALS], acceleration[GS4I_TILE_REALS], jumps[GS4I_TILE_REALS];
    int with_jumps, edge, sticks; /* may contact be here, and with sticky bodies? */
    uint64_t clear_nodes[GS4I_TILE];
    const uint64_t *clear; /* these, or NULL: see gs4i_correct_contact */
} gs4i_correction_tiles;

/* Gather for n particles; `u` keeps what came of the velocity. A batch with solids wants the
 * gradients of all. */
GS4I_INLINE void gs4i_gather_corrections(const gs4i_correction_tiles *t, const gs4i_stencils *s,
                                         int n, int solids, const gs4i_near_particles *near,
                                         gs4i_gathered *u, gs4i_corrections *k)
{
    gs4i_gathered acc, jump;
    int b;
    for (b = 0; b < n; b++) {
        const int at = 4 * s->base[b];
        gs4i_row w, d;
        gs4i_x_weights(s, b, &w, &d);
        gs4i_gather_local(t->velocity + at, s, b, &w, &d, u);
        gs4i_gather_rate(solids, t->acceleration + at, s, b, &w, &d, &acc);
        if (t->with_jumps) gs4i_gather_rate(solids, t->jumps + at, s, b, &w, &d, &jump);
    }
    if (near->particle) gs4i_make_odd(near, n, solids, u, &acc);
    gs4i_to_lanes(u->value, n, k->U);
    gs4i_gradient_lanes(u->dx, u->dy, u->dz, n, k->L);
    gs4i_to_lanes(acc.value, n, k->A);
    if (t->with_jumps) gs4i_to_lanes(jump.value, n, k->jump);
    if (solids) gs4i_load_gathered_rates(&acc, t->with_jumps ? &jump : NULL, n, &k->rates);
}

/* What S7 needs for the decay of what the grid does not see, beside the sub-grid velocity. */
GS4I_INLINE void gs4i_prepare_decay(gs4i_response *r, size_t i, int n, int solids,
                                    gs4i_corrections *k)
{
    const gs4i_integrator *integrator = r->integrator;
    int b;
    if (solids)
        GS4I_BATCH_LOOP(b) k->rates.decay[b] = integrator->decay + k->subgrid[3][b];
    if (!(integrator->volume_crossing > 0)) return;
    gs4i_turn_to_batch(r, i, n);
    GS4I_BATCH_LOOP(b) k->volume[b] = k->A[3][b] / r->constants.tait[b];
}

/* Near sticky colliders images of a curved surface overlap, and would pass for material. */
static gs4i_integrator gs4i_integrator_of_block(const gs4_sim *sim, int o)
{
    gs4i_integrator r = sim->integrator;
    if (gs4i_near_particles_of(sim, o).particle) r.unpacking = 0;
    return r;
}

GS4I_INLINE void gs4i_load_corrections(const gs4_sim *sim, int o, gs4i_correction_tiles *tiles)
{
    const gs4i_grid *g = &sim->grid;
    const uint64_t rows = sim->reports[o].rows;
    tiles->with_jumps = gs4i_load_jumps(g, o, rows, tiles->jumps);
    tiles->edge = tiles->with_jumps || gs4i_at_edge(g, o);
    tiles->sticks = tiles->with_jumps && gs4i_sticks_near(sim, o);
    tiles->clear = tiles->edge ? gs4i_find_clear_nodes(sim, o, tiles->clear_nodes) : NULL;
    gs4i_tile_load(g, o, rows, gs4i_gradient_velocity(g), tiles->velocity);
    gs4i_tile_load(g, o, rows, gs4i_acceleration(g), tiles->acceleration);
}

/* S7: load, gather, correct, then validate or store. With `commit` 0 nothing is written: a trial
 * that only reports, of blocks that are not safe. */
static void gs4i_correct(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    const gs4i_grid *g = &sim->grid;
    const gs4i_particles p = sim->particles;
    gs4i_heat_pass heat_pass, *heat = p.with_heat ? &heat_pass : NULL;
    const gs4i_integrator integrator = gs4i_integrator_of_block(sim, pass->blocks[index]);
    const int o = pass->blocks[index], next = gs4i_next_block(pass, index);
    const gs4i_frame frame = gs4i_tile_frame(g, g->occupied_block[o]);
    gs4i_near_particles near = gs4i_near_particles_of(sim, o);
    gs4i_report *report = &sim->reports[o];
    gs4i_response r;
    gs4i_correction_tiles tiles;
    gs4i_corrections k;
    gs4i_gathered u;
    int row = 0;
    size_t i = (size_t)g->first[o], end = (size_t)g->first[o + 1];
    if (!pass->commit && gs4i_is_safe(pass, index)) return;
    gs4i_load_corrections(sim, o, &tiles);
    gs4i_begin_response(&r, sim, &p, &integrator, report, heat);
    memset(&k, 0, sizeof k);
    if (heat) gs4i_load_heat_tiles(sim, o, heat);
    for (; i < end; i += GS4I_BATCH, row += 2) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s;
        gs4i_stored out;
        int solids = 0;
        gs4i_tile_prefetch(g, next, row, gs4i_gradient_velocity(g));
        gs4i_tile_prefetch(g, next, row, gs4i_acceleration(g));
        if (p.deformation_reals) {
            gs4i_turn_to_batch(&r, i, n);
            solids = gs4i_load_solid_constants(&r.constants, &r.solid);
        }
        gs4i_stage_batch(&p, i, n, integrator.prediction, &frame, &q, &s);
        gs4i_gather_corrections(&tiles, &s, n, solids, &near, &u, &k);
        if (near.particle) near.particle += n;
        if (p.with_subgrid) {
            gs4i_prefetch_subgrid(&p, i + 4 * GS4I_BATCH);
            gs4i_to_lanes(p.subgrid + 4 * i, n, k.subgrid);
            if (tiles.sticks) gs4i_limit_jumps(&k);
        }
        gs4i_prepare_decay(&r, i, n, solids, &k);
        gs4i_correct_batch(integrator, &k, &q);
        gs4i_advance_response(&r, i, n, k.L, &k.rates, q.v[3], pass->commit);
        if (!pass->commit) {
            gs4i_validate_batch(&q, k.L, p.position + 4 * i, n, g->h, p.id + i, report);
            continue;
        }
        if (heat) gs4i_gather_heat(&r, &s, k.L, heat);
        gs4i_pack_batch(&q, 1, &out);
        if (tiles.edge) gs4i_correct_contact(sim, o, tiles.clear, i, n, &out, &u, report);
        gs4i_see_motion(&r.seen, q.v, k.L);
        gs4i_store_batch(&p, i, n, &out);
    }
    if (pass->commit) gs4i_report_motion(report, &r.seen);
}

/* S4 to S6. */
static int gs4i_accelerate_explicitly(gs4_sim *sim, gs4i_node_pass *nodes)
{
    const gs4i_boundary *b = &sim->boundary;
    const gs4i_grid *g = &sim->grid;
    gs4i_scatter(sim, gs4i_scatter_stage);
    gs4i_finish_forces(sim, nodes);
    gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_node_accelerations, nodes);
    gs4i_fill_mirror_nodes(b, g, gs4i_velocity(g));
    if (g->with_deconvolution) gs4i_deconvolve(sim, nodes);
    gs4i_fill_mirror_nodes(b, g, gs4i_acceleration(g));
    if (sim->integrator.unpacking > 0) gs4i_fill_mirror_masses(b, g);
    gs4i_gather_image_particles(sim, gs4i_gather_image_velocity);
    gs4i_gather_image_particles(sim, gs4i_gather_image_acceleration);
    return GS4_OK;
}

/* Largest eigenvalues of the discrete operators on particles, times h^2: of div grad as sound
 * meets it, and of 2 div D as viscosity does. Measured in tests/test_stability.c. */
#define GS4I_SOUND_EIGENVALUE 3.0
#define GS4I_VISCOUS_EIGENVALUE 2.5
/* so many times as large with deconvolved gradients; measured there too */
#define GS4I_DECONVOLVED_EIGENVALUES 2.3

/* (w dt)^2 + d dt (3 + r + s - r s)/2 <= 2 (1 - r s), r and s the two rho, w the frequency of the
 * fastest wave that the grid holds and d its fastest viscous rate. */
static double gs4i_stable_explicit_dt(const gs4_sim *sim, double c, double nu)
{
    const double r = (double)sim->desc.rho_inf, s = (double)sim->desc.rho_inf_spurious,
                 h = (double)sim->grid.h;
    const double sharper =
        sim->desc.sharp_gradients ? (double)GS4I_C(GS4I_DECONVOLVED_EIGENVALUES) : 1;
    const double a = 2 * (1 - r * s), b = (3 + r + s - r * s) / 2;
    const double w = sqrt(sharper * GS4I_SOUND_EIGENVALUE) * c / h;
    const double d = sharper * b * GS4I_VISCOUS_EIGENVALUE * nu / (h * h);
    return d + w > 0 ? 2 * a / (d + sqrt(d * d + 4 * w * w * a)) : (double)GS4I_HUGE;
}

/* --- symplectic Euler ------------------------------------------------------------------------- */

/* The velocity gradients of n particles. */
GS4I_INLINE void gs4i_load_affine(const gs4i_particles *p, size_t i, int n, gs4i_gradient L)
{
    gs4i_gradient_lanes(p->affine[0] + 4 * i, p->affine[1] + 4 * i, p->affine[2] + 4 * i, n, L);
}

/* Momentum and impulse of stress and weight as one affine field: m (v + dt g) + (m C - dt V sigma
 * 4/h^2) (x_i - x). */
GS4I_INLINE void gs4i_affine_momentum(gs4i_response *r, const gs4i_batch *q, const gs4i_stencils *s,
                                      gs4i_gradient C, gs4_real h, const gs4_vec3 *gravity,
                                      gs4i_affine_forces *f)
{
    const gs4_real dt = r->integrator->dt,
                   fall[3] = { dt * gravity->x, dt * gravity->y, dt * gravity->z };
    gs4i_symmetric sigma;
    gs4i_lanes bound, k, middle[3], mu, none;
    gs4i_gradient Q;
    int b, i, j;
    gs4i_stress(r, C, q->v[3], sigma, mu);
    gs4i_check_liquids(r->report, q->v[3], mu, r->p->id + r->i, r->n);
    if (r->heat) gs4i_heat_of_stress(r, q->x[3], q->v[3], C, sigma);
    gs4i_affine_bound(C, dt, bound);
    GS4I_BATCH_LOOP(b) {
        bound[b] *= q->x[3][b] * h;
        k[b] = -dt * q->x[3][b] * r->constants.inv_density[b] * q->v[3][b] * (4 / h);
    }
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++)
            GS4I_BATCH_LOOP(b)
                Q[i][j][b] = bound[b] * C[i][j][b] + k[b] * sigma[gs4i_place[i][j]][b];
    for (i = 0; i < 3; i++)
        GS4I_BATCH_LOOP(b)
            middle[i][b] =
                q->x[3][b] * (q->v[i][b] + fall[i])
                - (Q[i][0][b] * s->xi[0][b] + Q[i][1][b] * s->xi[1][b] + Q[i][2][b] * s->xi[2][b]);
    memset(none, 0, sizeof none);
    gs4i_from_lanes(middle[0], middle[1], middle[2], q->x[3], f->middle);
    gs4i_from_lanes(Q[0][0], Q[1][0], Q[2][0], none, f->x);
    gs4i_from_lanes(Q[0][1], Q[1][1], Q[2][1], none, f->y);
    gs4i_from_lanes(Q[0][2], Q[1][2], Q[2][2], none, f->z);
}

/* Symplectic Euler, there: one affine scatter with stress (MLS-MPM). */
static void gs4i_scatter_affinely(int index, void *context)
{
    const gs4i_prediction now = { 0, 0, 0 };
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    const gs4i_grid *g = &sim->grid;
    const gs4i_particles p = sim->particles;
    gs4i_heat_pass heat_pass, *heat = p.with_heat ? &heat_pass : NULL;
    const int o = pass->blocks[index];
    const gs4i_frame frame = gs4i_tile_frame(g, g->occupied_block[o]);
    gs4i_report *report = &sim->reports[o];
    gs4i_response r;
    gs4_real tile[GS4I_TILE_REALS];
    gs4i_near_particles near = gs4i_near_particles_of(sim, o);
    int row = 0;
    size_t i = (size_t)g->first[o], end = (size_t)g->first[o + 1];
    gs4i_report_clear(report);
    memset(tile, 0, sizeof tile);
    gs4i_begin_response(&r, sim, &p, &sim->integrator, report, heat);
    if (heat) gs4i_clear_heat_tiles(heat);
    for (; i < end; i += GS4I_BATCH, row += 2) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s;
        gs4i_gradient C;
        gs4i_affine_forces f;
        int b;
        gs4i_tile_prefetch(g, o, row, g->momentum);
        gs4i_stage_batch(&p, i, n, now, &frame, &q, &s);
        gs4i_load_affine(&p, i, n, C);
        gs4i_turn_to_batch(&r, i, n);
        if (heat) gs4i_load_batch_heat(&r);
        gs4i_affine_momentum(&r, &q, &s, C, g->h, &sim->desc.gravity, &f);
        for (b = 0; b < n; b++) {
            if (s.base[b] < 0) {
                report->left_tile++;
                continue;
            }
            report->rows |= gs4i_touched_rows(s.base[b]);
            gs4i_scatter_affine(tile, &s, b, &f);
        }
        if (near.particle) {
            gs4i_reflect_affine(&near, n, &s, &f, g->h);
            near.particle += n;
        }
        if (heat) gs4i_scatter_heat(sim, heat, &s, n);
    }
    gs4i_report_liquids(report, &r.seen);
    gs4i_tile_add(g, o, report->rows, tile, g->momentum);
    if (heat) gs4i_add_heat(sim, o, heat);
}

/* v = sum w v_i, C = sum v_i (x) grad w, J += dt J tr C, then gs4i_unpack, x += dt v. */
GS4I_INLINE void gs4i_advect_batch(const gs4i_integrator *r, const gs4i_gathered *u, int n,
                                   gs4i_batch *q, gs4i_gradient C)
{
    const gs4_real dt = r->dt;
    gs4i_lanes v[4];
    int b, c;
    gs4i_to_lanes(u->value, n, v);
    gs4i_gradient_lanes(u->dx, u->dy, u->dz, n, C);
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b) {
            q->x[c][b] += dt * v[c][b];
            q->v[c][b] = v[c][b];
        }
    GS4I_BATCH_LOOP(b) q->v[3][b] += dt * q->v[3][b] * (C[0][0][b] + C[1][1][b] + C[2][2][b]);
    if (r->unpacking > 0)
        GS4I_BATCH_LOOP(b) {
            gs4i_wide rate;
            gs4i_unpack(r, &v[3][b], &q->v[3][b], &rate);
            q->v[3][b] += dt * rate;
        }
}

/* Symplectic Euler, and back. */
static void gs4i_gather_euler(int index, void *context)
{
    const gs4i_prediction now = { 0, 0, 0 };
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    const gs4i_grid *g = &sim->grid;
    const gs4i_particles p = sim->particles;
    gs4i_heat_pass heat_pass, *heat = p.with_heat ? &heat_pass : NULL;
    const int o = pass->blocks[index], next = gs4i_next_block(pass, index);
    const int edge = gs4i_at_edge(g, o) || gs4i_jumps_are_near(g, o);
    const gs4i_frame frame = gs4i_tile_frame(g, g->occupied_block[o]);
    gs4i_near_particles near = gs4i_near_particles_of(sim, o);
    const gs4i_integrator integrator = gs4i_integrator_of_block(sim, o);
    gs4i_report *report = &sim->reports[o];
    gs4i_response r;
    gs4_real nodes[GS4I_TILE_REALS];
    uint64_t clear_nodes[GS4I_TILE];
    const uint64_t *clear;
    int row = 0;
    size_t i = (size_t)g->first[o], end = (size_t)g->first[o + 1];
    if (!pass->commit && gs4i_is_safe(pass, index)) return;
    clear = edge && pass->commit ? gs4i_find_clear_nodes(sim, o, clear_nodes) : NULL;
    gs4i_tile_load(g, o, report->rows, gs4i_velocity(g), nodes);
    gs4i_begin_response(&r, sim, &p, &sim->integrator, report, heat);
    if (heat) gs4i_load_heat_tiles(sim, o, heat);
    for (; i < end; i += GS4I_BATCH, row += 2) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s;
        gs4i_gradient C;
        gs4i_gathered u;
        gs4i_stored out;
        int b;
        gs4i_tile_prefetch(g, next, row, gs4i_velocity(g));
        gs4i_stage_batch(&p, i, n, now, &frame, &q, &s);
        for (b = 0; b < n; b++) {
            gs4i_row w, d;
            gs4i_x_weights(&s, b, &w, &d);
            gs4i_gather_local(nodes + 4 * s.base[b], &s, b, &w, &d, &u);
        }
        if (near.particle) gs4i_make_odd(&near, n, 0, &u, NULL);
        gs4i_advect_batch(&integrator, &u, n, &q, C);
        gs4i_advance_response(&r, i, n, C, NULL, q.v[3], pass->commit);
        if (!pass->commit) {
            gs4i_validate_batch(&q, C, p.position + 4 * i, n, g->h, p.id + i, report);
            if (near.particle) near.particle += n;
            continue;
        }
        if (heat) gs4i_gather_heat(&r, &s, C, heat);
        gs4i_pack_batch(&q, 0, &out);
        if (edge) gs4i_correct_contact(sim, o, clear, i, n, &out, &u, report);
        if (near.particle) near.particle += n;
        gs4i_see_motion(&r.seen, q.v, C);
        gs4i_store_batch(&p, i, n, &out);
        memcpy(p.affine[0] + 4 * i, u.dx, 4 * (size_t)n * sizeof *u.dx);
        memcpy(p.affine[1] + 4 * i, u.dy, 4 * (size_t)n * sizeof *u.dy);
        memcpy(p.affine[2] + 4 * i, u.dz, 4 * (size_t)n * sizeof *u.dz);
    }
    if (pass->commit) gs4i_report_motion(report, &r.seen);
}

/* Stress and weight are in the momentum already. */
static int gs4i_accelerate_nothing(gs4_sim *sim, gs4i_node_pass *nodes)
{
    if (sim->integrator.unpacking > 0) gs4i_fill_mirror_masses(&sim->boundary, &sim->grid);
    (void)nodes;
    return GS4_OK;
}

/* Lone particles with their affine field: sum |grad w|^2 / w, times h^2. */
#define GS4I_EULER_SOUND_EIGENVALUE 12.0
#define GS4I_EULER_VISCOUS_EIGENVALUE 16.0

/* (w dt)^2 + 2 d dt <= 4. */
static double gs4i_stable_euler_dt(const gs4_sim *sim, double c, double nu)
{
    const double h = (double)sim->grid.h, w = sqrt(GS4I_EULER_SOUND_EIGENVALUE) * c / h,
                 d = 2 * GS4I_EULER_VISCOUS_EIGENVALUE * nu / (h * h);
    return d + w > 0 ? 8 / (d + sqrt(d * d + 16 * w * w)) : (double)GS4I_HUGE;
}

/* ==== [[staggered]] velocities on faces ======================================================== *
 *
 * The grid of the partitioned scheme: a dense box (see [[box]]) around all blocks with nodes, those
 * behind walls included. Velocities are at faces, each component at those across its axis; volumes
 * and pressures in cells. Quadratic B-splines, each component with its own weights:
 *
 *          +--v--+--v--+          u  faces across x, place 1
 *          u  p  u  p  u          v  faces across y, place 2
 *          +--v--+--v--+          p  cells, place 0
 *
 * A face has two quads. What particles give to it, and what is made of that in place; and what
 * particles take from it. */

enum {
    /* given: momentum -> v_i -> v**; m dv/dt -> P a -> ag; volume -> density; mass */
    GS4I_FACE_VELOCITY = 0,
    GS4I_FACE_RATE,
    GS4I_FACE_DENSITY,
    GS4I_FACE_MASS,
    /* taken: u~; acc, then with feedback; that, then v_i; velocity of the volume correction */
    GS4I_FACE_STAGE = 0,
    GS4I_FACE_ACCELERATION,
    GS4I_FACE_FEEDBACK,
    GS4I_FACE_GUESS = GS4I_FACE_FEEDBACK, /* first u~ of what is held */
    GS4I_FACE_SEEN = GS4I_FACE_FEEDBACK,
    GS4I_FACE_CORRECTION
};

/* What a face knows of its u~: nothing; the solve (1) or a wall (2) has given it; or it was
 * extrapolated, in layer 3, 4, ... */
enum {
    GS4I_FACE_UNKNOWN = 0,
    GS4I_FACE_SOLVED,
    GS4I_FACE_AT_WALL,
    GS4I_FACE_LAYER
};
#define GS4I_FACE_LAYERS 3

/* Of a cell, four numbers: volume of material (m^3) -> its share of the cell; and weighed by it,
 * then divided by it: 1/K (1/Pa), J** - 1 -> pressure (Pa). */
enum {
    GS4I_CELL_FILL = 0,
    GS4I_CELL_DIVERGENCE = GS4I_CELL_FILL, /* in tiles, for particles */
    GS4I_CELL_COMPLIANCE,
    GS4I_CELL_DILATION,
    GS4I_CELL_PRESSURE = GS4I_CELL_DILATION,
    GS4I_CELL_SOLID /* share of its kernel that bodies take */
};

/* Transfers go by tiles as those of nodes do: 8^3 cells around a block, and as many faces of each
 * axis, tile [place of a face's axis + 1]; cells are tile [0]. Weights of faces are those of nodes
 * in a tile that lies half a cell lower along their axis. */
typedef gs4_real gs4i_face_tile[GS4I_TILE_REALS];

static void gs4i_face_stencils_at(gs4i_stencils s[4], const gs4i_frame *cells, gs4i_lanes x[3])
{
    int place;
    for (place = 0; place < 4; place++) {
        gs4i_frame frame = *cells;
        if (place) frame.first[place - 1] -= GS4I_C(0.5);
        gs4i_stencils_at(&s[place], &frame, x);
    }
}

/* Is particle b where the tiles have faces? They go half a cell further up than nodes. */
GS4I_INLINE int gs4i_is_in_tiles(const gs4i_stencils s[4], int b)
{
    return (s[0].base[b] | s[1].base[b] | s[2].base[b] | s[3].base[b]) >= 0;
}

/* S2: a batch and its weights at the predicted positions. */
GS4I_INLINE void gs4i_stage_faces(const gs4_sim *sim, const gs4i_frame *cells, size_t i, int n,
                                  gs4i_batch *q, gs4i_stencils s[4])
{
    gs4i_lanes x[3];
    gs4i_load_batch(&sim->particles, i, n, sim->integrator.prediction, q);
    gs4i_predict_positions(q, sim->integrator.prediction, x);
    gs4i_face_stencils_at(s, cells, x);
}

/* Where row (y, z) of the tile of occupied block o begins in a field of the box. */
GS4I_INLINE size_t gs4i_face_row(const gs4i_staggered *f, const int first[3], int place, int row)
{
    return gs4i_box_index(&f->box, place, first[0] - f->box.low[0] - 2,
                          first[1] - f->box.low[1] - 2 + (row & 7),
                          first[2] - f->box.low[2] - 2 + (row >> 3));
}

/* Touched rows of quads into a tile, and the row behind each. */
static void gs4i_load_face_tile(const gs4_sim *sim, int o, int place,
                                const gs4_real *GS4I_RESTRICT field, gs4_real *GS4I_RESTRICT tile)
{
    const uint64_t rows = sim->reports[o].rows | sim->reports[o].rows << 1;
    int first[3], row;
    gs4i_block_origin(&sim->grid, sim->grid.occupied_block[o], first);
    for (row = 0; row < 64; row++, tile += 4 * GS4I_TILE)
        if (rows >> row & 1)
            memcpy(tile, field + 4 * gs4i_face_row(&sim->staggered, first, place, row),
                   4 * GS4I_TILE * sizeof *tile);
    memset(tile, 0, 16 * sizeof *tile);
}

/* A tile of quads, or of single numbers, to where its touched rows are in the box. */
static void gs4i_add_face_tile(const gs4_sim *sim, int o, int place, int reals,
                               const gs4_real *GS4I_RESTRICT tile, gs4_real *GS4I_RESTRICT field)
{
    const uint64_t rows = sim->reports[o].rows;
    int first[3], row, i;
    gs4i_block_origin(&sim->grid, sim->grid.occupied_block[o], first);
    for (row = 0; row < 64; row++, tile += reals * GS4I_TILE) {
        gs4_real *to;
        if (!(rows >> row & 1)) continue;
        to = field + (size_t)reals * gs4i_face_row(&sim->staggered, first, place, row);
        for (i = 0; i < reals * GS4I_TILE; i += 4) {
            gs4i_quad sum, q;
            GS4I_LOAD(sum, to + i);
            GS4I_LOAD(q, tile + i);
            GS4I_SUM(sum, sum, q);
            GS4I_STORE(to + i, sum);
        }
    }
}

/* Has any material stress beside the pressure? */
static int gs4i_has_stress(const gs4_sim *sim)
{
    int i, any = sim->particles.elastic_reals || sim->particles.deformation_reals;
    for (i = 0; i < sim->material_count; i++)
        any |= sim->constants[i].viscosity > 0 || sim->constants[i].varies;
    return any;
}

/* The box around all blocks with nodes; along a periodic axis all of the domain, and a block of
 * copies on each side. */
static void gs4i_fit_staggered(gs4i_staggered *f, const gs4i_grid *g)
{
    gs4i_box *box = &f->box;
    int s, a, high[3];
    for (a = 0; a < 3; a++) {
        const int whole = box->periodic[a] = g->periodic[a];
        box->low[a] = whole ? -GS4I_BLOCK_SIDE : g->cells[a] + GS4I_BLOCK_SIDE;
        high[a] = whole ? g->cells[a] + GS4I_BLOCK_SIDE : -GS4I_BLOCK_SIDE;
    }
    for (s = 0; s < g->active; s++) {
        int first[3];
        gs4i_block_origin(g, g->block[s], first);
        for (a = 0; a < 3; a++) {
            if (first[a] < box->low[a]) box->low[a] = first[a];
            if (first[a] + GS4I_BLOCK_SIDE > high[a]) high[a] = first[a] + GS4I_BLOCK_SIDE;
        }
    }
    for (a = 0; a < 3; a++) {
        box->size[a] = high[a] - box->low[a];
        f->from[a] = box->low[a] < 0 ? -box->low[a] : 0;
        f->to[a] = high[a] > g->cells[a] ? g->cells[a] - box->low[a] : box->size[a];
        f->first[a] = g->periodic[a] ? f->from[a] : 0;
        f->end[a] = g->periodic[a] ? f->to[a] : box->size[a];
    }
}

/* Its fields, the largest first; those of bodies and of stress only where there is some. */
static void gs4i_take_staggered(gs4i_staggered *f, int bodies, int stress, int separates)
{
    gs4i_box *box = &f->box;
    const size_t real = sizeof(gs4_real);
    const int wraps = gs4i_box_is_periodic(box);
    int a;
    if (wraps) gs4i_elliptic_take_periodic(&f->system, box);
    for (a = 0; a < 3; a++) {
        f->given[a] = (gs4_real *)gs4i_box_take(box, 4 * real);
        f->taken[a] = (gs4_real *)gs4i_box_take(box, 4 * real);
    }
    f->cell = (gs4_real *)gs4i_box_take(box, 4 * real);
    for (a = 0; a < 3; a++) f->body[a] = bodies ? (gs4_real *)gs4i_box_take(box, 2 * real) : NULL;
    for (a = 0; a < 3; a++) {
        f->open[a] = bodies ? (gs4_real *)gs4i_box_take(box, real) : NULL;
        f->force[a] = stress ? (gs4_real *)gs4i_box_take(box, real) : NULL;
        f->seen[a] = (gs4_real *)gs4i_box_take(box, real);
        f->reach[a] = (gs4_real *)gs4i_box_take(box, real);
    }
    f->diagonal = (gs4_real *)gs4i_box_take(box, real);
    f->rhs = (gs4_real *)gs4i_box_take(box, real);
    f->pressure = (gs4_real *)gs4i_box_take(box, real);
    f->system.scratch = wraps ? (gs4_real *)gs4i_box_take(box, real) : NULL;
    for (a = 0; a < 3; a++) {
        f->known[a] = (uint8_t *)gs4i_box_take(box, 1);
        f->held[a] = bodies ? (uint8_t *)gs4i_box_take(box, 1) : NULL;
    }
    f->kind = (uint8_t *)gs4i_box_take(box, 1);
    f->system.kind = wraps ? (uint8_t *)gs4i_box_take(box, 1) : f->kind;
    f->contact = separates ? (uint8_t *)gs4i_box_take(box, 1) : NULL;
}

/* Is there anything that material can leave? */
static int gs4i_has_separating(const gs4_sim *sim)
{
    int i, any = 0;
    for (i = 0; i < 6; i++) any |= sim->desc.walls[i] == GS4_WALL_SEPARATE;
    return any;
}

/* Is there a body that liquid slides along? What div acc is in cells that it cuts is not known well
 * enough for (P2): tr(L L) there fed energy, and blew up around what turned. */
static int gs4i_has_slippery(const gs4_sim *sim)
{
    int i, any = 0;
    for (i = 0; i < sim->boundary.collider_count; i++) {
        const gs4i_collider *b = &sim->boundary.colliders[i];
        any |= !b->is_emitter && !gs4i_is_sticky(b);
    }
    return any;
}

/* What is scattered to, of a plane. */
static void gs4i_clear_staggered(int z, void *context)
{
    gs4i_staggered *f = (gs4i_staggered *)context;
    int c;
    for (c = 0; c < 4; c++) {
        const int place = c < 3 ? 1 << c : GS4I_AT_CELL;
        const size_t from = gs4i_box_index(&f->box, place, 0, 0, z),
                     n = gs4i_box_index(&f->box, place, 0, 0, z + 1) - from;
        gs4_real *field = c < 3 ? f->given[c] : f->cell;
        if (z >= gs4i_box_length(&f->box, place, 2)) continue;
        memset(field + 4 * from, 0, 4 * n * sizeof *field);
        if (c < 3 && f->force[c]) memset(f->force[c] + from, 0, n * sizeof *field);
    }
}

/* Room for a step, with nothing on the faces. */
static int gs4i_begin_staggered(gs4_sim *sim)
{
    gs4i_staggered *f = &sim->staggered;
    const int bodies = sim->boundary.collider_count > 0, stress = gs4i_has_stress(sim),
              separates = gs4i_has_separating(sim);
    /* per face of each axis: given, taken, seen, reach and force; per cell: 4 and 3 */
    size_t bytes = (size_t)(3 * (4 + 4 + 2 + stress) + 4 + 3 + (bodies ? 9 : 0)) * sizeof(gs4_real)
                   + (size_t)((bodies ? 7 : 4) + separates);
    int a;
    gs4i_fit_staggered(f, &sim->grid);
    if (gs4i_box_is_periodic(&f->box))
        bytes += 6 * sizeof(double) + sizeof(size_t) + 2 * sizeof(gs4_real) + 1;
    if (gs4i_box_reserve(&sim->memory, &f->box, bytes) != GS4_OK)
        return gs4i_fail_memory(&sim->error);
    gs4i_take_staggered(f, bodies, stress, separates);
    gs4i_parallel_for(&sim->tasks, f->box.size[2] + 1, gs4i_clear_staggered, f);
    f->system.solver.memory = &sim->memory;
    f->system.solver.tasks = &sim->tasks;
    f->iterations = 0;
    f->residual = 0;
    f->is_viscous = stress;
    f->compressible = 0;
    for (a = 0; a < sim->material_count; a++) f->compressible |= sim->constants[a].compliance > 0;
    f->is_plain = f->compressible || gs4i_has_slippery(sim);
    return GS4_OK;
}

static void gs4i_free_staggered(gs4i_memory *m, gs4i_staggered *f)
{
    gs4i_box_free(m, &f->box);
    f->system.solver.memory = m;
    gs4i_solver_free(&f->system.solver);
    gs4i_free(m, f->fitted.data, f->fitted.bytes, 1);
    gs4i_free(m, f->fit.data, f->fit.bytes, 1);
}

/* --- walls ------------------------------------------------------------------------------------ */

/* Parity of component c at a wall of this side: even behind a periodic one; odd along the normal,
 * and along a sticky wall. A liquid without viscosity does not feel that: odd there would be a
 * source of energy. */
static gs4_real gs4i_wall_parity(const gs4_sim *sim, int c, int side)
{
    const gs4_wall wall = sim->desc.walls[side];
    return wall != GS4_WALL_PERIODIC
                   && (c == side / 2 || (wall == GS4_WALL_STICK && sim->staggered.is_viscous))
               ? GS4I_C(-1)
               : GS4I_C(1);
}

/* Plane m, 1 ..., of a place behind a wall, and its image: a mirror's, or that a period away. Is it
 * in the box? */
static int gs4i_mirror_planes(const gs4i_staggered *f, int place, int side, int m, int *behind,
                              int *image)
{
    const int a = side / 2, on_face = place >> a & 1, n = gs4i_box_length(&f->box, place, a);
    const int low = f->from[a] - 1 + on_face, high = f->to[a]; /* first inner - 1; last wall */
    const int period = f->to[a] - f->from[a];
    if (f->box.periodic[a]) { /* the last face of the domain is a copy of the first */
        *behind = side & 1 ? f->to[a] + m - 1 : f->from[a] - m;
        *image = f->from[a] + (side & 1 ? (m - 1) % period : (period - 1) - (m - 1) % period);
    } else if (side & 1) {
        *behind = on_face ? high + m : high - 1 + m;
        *image = on_face ? high - m : high - m;
    } else {
        *behind = on_face ? low - m : low + 1 - m;
        *image = on_face ? low + m : low + m;
    }
    return *behind >= 0 && *behind < n && *image >= 0 && *image < n;
}

/* Is entry `at` of a place a copy, behind a periodic wall? */
GS4I_INLINE int gs4i_is_copy(const gs4i_staggered *f, const int at[3])
{
    int a, outside = 0;
    for (a = 0; a < 3; a++) outside |= at[a] < f->first[a] || at[a] >= f->end[a];
    return outside && gs4i_box_is_periodic(&f->box);
}

/* Index of a cell along an axis, or of a face before one: around a periodic axis that of which it
 * is a copy. */
GS4I_INLINE int gs4i_around(const gs4i_staggered *f, int axis, int at)
{
    const int first = f->first[axis], period = f->end[axis] - first;
    return f->box.periodic[axis] ? first + ((at - first) % period + period) % period : at;
}

/* Is there a wall that mirrors, or a periodic one, within the box? */
static int gs4i_has_wall(const gs4_sim *sim, int side)
{
    const gs4i_staggered *f = &sim->staggered;
    const int a = side / 2;
    return sim->desc.walls[side] != GS4_WALL_OPEN
           && (side & 1 ? f->to[a] < f->box.size[a] : f->from[a] > 0);
}

/* The wall cell on a side, of the column where an entry `at` of a place is, or of that half a cell
 * lower along `low` of the other axes; columns behind other walls are those that they mirror. */
static size_t gs4i_wall_cell(const gs4_sim *sim, int side, const int at[3], int low)
{
    const gs4i_staggered *f = &sim->staggered;
    int p[3], t;
    for (t = 0; t < 3; t++) {
        p[t] = gs4i_around(f, t, at[t] - (low >> t & 1));
        if (p[t] < f->from[t] && gs4i_has_wall(sim, 2 * t)) p[t] = 2 * f->from[t] - 1 - p[t];
        if (p[t] >= f->to[t] && gs4i_has_wall(sim, 2 * t + 1)) p[t] = 2 * f->to[t] - 1 - p[t];
        if (t == side / 2) p[t] = side & 1 ? f->to[t] - 1 : f->from[t];
        p[t] = p[t] < 0 ? 0 : p[t] < f->box.size[t] ? p[t] : f->box.size[t] - 1;
    }
    return gs4i_box_index(&f->box, GS4I_AT_CELL, p[0], p[1], p[2]);
}

/* Does the wall on a side act on what is at an entry of a place? One that separates does where it
 * is in contact. */
static int gs4i_wall_holds(const gs4_sim *sim, int side, int place, const int at[3])
{
    const uint8_t *contact = sim->staggered.contact;
    const int low = place & ~(1 << side / 2);
    if (sim->desc.walls[side] != GS4_WALL_SEPARATE) return 1;
    return ((contact[gs4i_wall_cell(sim, side, at, 0)]
             | contact[gs4i_wall_cell(sim, side, at, low)])
            >> side)
           & 1;
}

/* One entry behind a wall: its index, that of its image and of the wall's own face. */
typedef struct gs4i_face_mirror {
    size_t behind, image, wall;
    gs4_real parity;
    int is_normal; /* the component across the wall */
    int holds;     /* 0: a wall that material has left */
    size_t bytes;  /* of an entry, where it is copied */
} gs4i_face_mirror;
typedef void (*gs4i_mirror_fn)(void *field, const gs4i_face_mirror *m);

/* One side for gs4i_parallel_for: a task for each plane, or row, across the wall. */
typedef struct gs4i_mirror_pass {
    const gs4_sim *sim;
    void *field;
    gs4i_mirror_fn fn;
    size_t bytes;
    int place, side;
} gs4i_mirror_pass;

static void gs4i_mirror_plane(int index, void *context)
{
    const gs4i_mirror_pass *pass = (const gs4i_mirror_pass *)context;
    const gs4i_staggered *f = &pass->sim->staggered;
    const gs4i_box *box = &f->box;
    const int place = pass->place, side = pass->side;
    const int a = side / 2, b = a == 0 ? 1 : 0, c = 3 - a - b;
    const int separates = pass->sim->desc.walls[side] == GS4_WALL_SEPARATE;
    const size_t step = b ? (size_t)gs4i_box_length(box, place, 0) : 1;
    int m, behind, image, at[3];
    gs4i_face_mirror one;
    one.is_normal = place == 1 << a && !box->periodic[a];
    one.bytes = pass->bytes;
    one.parity = place ? gs4i_wall_parity(pass->sim, place >> 1, side) : GS4I_C(1);
    at[c] = index;
    for (m = 1; m <= 4 && gs4i_mirror_planes(f, place, side, m, &behind, &image); m++) {
        at[b] = 0;
        at[a] = behind;
        one.behind = gs4i_box_index(box, place, at[0], at[1], at[2]);
        at[a] = image;
        one.image = gs4i_box_index(box, place, at[0], at[1], at[2]);
        at[a] = side & 1 ? f->to[a] : f->from[a];
        one.wall = one.is_normal ? gs4i_box_index(box, place, at[0], at[1], at[2]) : 0;
        for (; at[b] < gs4i_box_length(box, place, b); at[b]++) {
            one.holds = !separates || gs4i_wall_holds(pass->sim, side, place, at);
            pass->fn(pass->field, &one);
            one.behind += step;
            one.image += step;
            one.wall += step;
        }
    }
}

static void gs4i_mirror_side(gs4i_mirror_pass *pass)
{
    const gs4_sim *sim = pass->sim;
    if (gs4i_has_wall(sim, pass->side))
        gs4i_parallel_for(&sim->tasks,
                          gs4i_box_length(&sim->staggered.box, pass->place, pass->side < 4 ? 2 : 1),
                          gs4i_mirror_plane, pass);
}

/* Apply `fn` to each entry behind the walls. Axis after axis: corners too. */
static void gs4i_each_mirror(gs4_sim *sim, int place, gs4_real *field, gs4i_mirror_fn fn)
{
    gs4i_mirror_pass pass;
    pass.sim = sim;
    pass.field = field;
    pass.fn = fn;
    pass.bytes = 0;
    pass.place = place;
    for (pass.side = 0; pass.side < 6; pass.side++) gs4i_mirror_side(&pass);
}

/* --- periodic axes: what is behind their walls is a copy -------------------------------------- */

static void gs4i_copy_entry(void *field, const gs4i_face_mirror *m)
{
    memcpy((char *)field + m->bytes * m->behind, (char *)field + m->bytes * m->image, m->bytes);
}

/* `bytes` an entry; no field, no copies. */
static void gs4i_wrap(gs4_sim *sim, int place, void *field, size_t bytes)
{
    gs4i_mirror_pass pass;
    pass.sim = sim;
    pass.field = field;
    pass.fn = gs4i_copy_entry;
    pass.bytes = bytes;
    pass.place = place;
    for (pass.side = 0; pass.side < 6 && field; pass.side++)
        if (sim->staggered.box.periodic[pass.side / 2]) gs4i_mirror_side(&pass);
}

static void gs4i_wrap_faces(gs4_sim *sim, gs4_real *const field[3], int reals)
{
    int c;
    for (c = 0; c < 3; c++) gs4i_wrap(sim, 1 << c, field[c], (size_t)reals * sizeof(gs4_real));
}

static void gs4i_wrap_bytes(gs4_sim *sim, uint8_t *const field[3])
{
    int c;
    for (c = 0; c < 3; c++) gs4i_wrap(sim, 1 << c, field[c], 1);
}

static void gs4i_wrap_cells(gs4_sim *sim, gs4_real *field, int reals)
{
    gs4i_wrap(sim, GS4I_AT_CELL, field, (size_t)reals * sizeof(gs4_real));
}

/* --- what mirrors do -------------------------------------------------------------------------- */

/* What was scattered stays where a wall does not hold. */
static void gs4i_fold_number(void *context, const gs4i_face_mirror *m)
{
    gs4_real *field = (gs4_real *)context;
    if (!m->holds) return;
    field[m->image] += m->parity * field[m->behind];
    field[m->behind] = 0;
}
static void gs4i_fold_given(void *context, const gs4i_face_mirror *m)
{
    gs4_real *field = (gs4_real *)context;
    size_t k;
    for (k = 0; k < 4 && m->holds; k++) {
        field[4 * m->image + k] += (k <= GS4I_FACE_RATE ? m->parity : 1) * field[4 * m->behind + k];
        field[4 * m->behind + k] = 0;
    }
}
static void gs4i_fill_number(void *context, const gs4i_face_mirror *m)
{
    gs4_real *field = (gs4_real *)context;
    field[m->behind] = m->parity * field[m->image];
}
static void gs4i_fill_given(void *context, const gs4i_face_mirror *m)
{
    gs4_real *field = (gs4_real *)context;
    if (m->holds) field[4 * m->behind] = m->parity * field[4 * m->image];
}
static void gs4i_fill_first(void *context, const gs4i_face_mirror *m)
{
    gs4_real *field = (gs4_real *)context;
    field[4 * m->behind] = m->parity * field[4 * m->image];
    if (m->is_normal && !m->holds) field[4 * m->behind] += 2 * field[4 * m->wall];
}
/* By their parity; but the feedback across a wall is not 0 on it, see gs4i_split_acceleration, and
 * nothing is where material has left it: there they go on straight. */
static void gs4i_fill_taken(void *context, const gs4i_face_mirror *m)
{
    gs4_real *field = (gs4_real *)context;
    size_t k;
    for (k = 0; k < 4; k++) field[4 * m->behind + k] = m->parity * field[4 * m->image + k];
    for (k = 0; k < 4 && m->is_normal; k++)
        if (k == GS4I_FACE_ACCELERATION || !m->holds)
            field[4 * m->behind + k] += 2 * field[4 * m->wall + k];
}

/* The same for the faces of all axes. */
static void gs4i_mirror_faces(gs4_sim *sim, gs4_real *const field[3], gs4i_mirror_fn fn)
{
    int c;
    for (c = 0; c < 3; c++) gs4i_each_mirror(sim, 1 << c, field[c], fn);
}

/* --- S3 --------------------------------------------------------------------------------------- */

/* C at the stage, from those of the last two: C + (C - before) times the ratio of steps; |C| dt at
 * most 1/4, or a splash without viscosity blows up. */
static void gs4i_stage_affine(const gs4_sim *sim, size_t i, int n, gs4i_gradient C)
{
    const gs4i_particles *p = &sim->particles;
    const gs4_real ratio = sim->integrator.affine_ratio;
    gs4i_gradient before;
    gs4i_lanes bound;
    int k, b;
    gs4i_gradient_lanes(p->affine[0] + 4 * i, p->affine[1] + 4 * i, p->affine[2] + 4 * i, n, C);
    gs4i_gradient_lanes(p->affine_before[0] + 4 * i, p->affine_before[1] + 4 * i,
                        p->affine_before[2] + 4 * i, n, before);
    for (k = 0; k < 9; k++)
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide change = C[k / 3][k % 3][b] - before[k / 3][k % 3][b];
            C[k / 3][k % 3][b] += ratio * change;
        }
    gs4i_affine_bound(C, sim->integrator.dt, bound);
    for (k = 0; k < 9; k++)
        GS4I_BATCH_LOOP(b) C[k / 3][k % 3][b] *= bound[b];
}

/* What a batch gives: momentum m (v~ + C (x_f - x~)), m a, volume and mass to faces; volume, and
 * what compresses it, to cells. */
typedef struct gs4i_face_gifts {
    gs4i_affine_forces faces[3];
    gs4_real cells[4 * GS4I_BATCH];
} gs4i_face_gifts;

static void gs4i_give_to_faces(const gs4_sim *sim, size_t i, int n, const gs4i_batch *q,
                               const gs4i_stencils s[4], gs4i_face_gifts *gifts)
{
    const gs4i_integrator *r = &sim->integrator;
    const gs4_real h = sim->grid.h;
    gs4i_gradient C;
    gs4i_lanes J, volume, compliance, squeeze, zero, momentum, rate, slope[3];
    int b, c, a;
    gs4i_stage_affine(sim, i, n, C);
    memset(zero, 0, sizeof zero);
    for (b = 0; b < GS4I_BATCH; b++) {
        const gs4i_material_constants *m = gs4i_constants_of(sim, i + (size_t)(b < n ? b : 0));
        GS4I_NTH(volume, b) = m->inv_density;
        GS4I_NTH(compliance, b) = m->compliance;
        GS4I_NTH(squeeze, b) = m->compliance > 0 ? GS4I_C(1) : GS4I_C(0);
    }
    GS4I_BATCH_LOOP(b) {
        J[b] = q->v[3][b] + r->before * q->a[3][b];
        volume[b] = q->x[3][b] * volume[b] * J[b];
        compliance[b] *= volume[b];
        squeeze[b] *= volume[b] * (J[b] - 1);
    }
    gs4i_from_lanes(volume, compliance, squeeze, zero, gifts->cells);
    for (c = 0; c < 3; c++) {
        const gs4i_stencils *at = &s[1 + c];
        gs4i_affine_forces *to = &gifts->faces[c];
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide m = q->x[3][b];
            for (a = 0; a < 3; a++) slope[a][b] = m * (h * C[c][a][b]);
            momentum[b] = m * (q->v[c][b] + r->prediction.ahead * q->a[c][b])
                          - ((slope[0][b] * at->xi[0][b] + slope[1][b] * at->xi[1][b])
                             + slope[2][b] * at->xi[2][b]);
            rate[b] = m * q->a[c][b];
        }
        gs4i_from_lanes(momentum, rate, volume, q->x[3], to->middle);
        gs4i_from_lanes(slope[0], zero, zero, zero, to->x);
        gs4i_from_lanes(slope[1], zero, zero, zero, to->y);
        gs4i_from_lanes(slope[2], zero, zero, zero, to->z);
    }
}

static void gs4i_scatter_to_faces(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    gs4i_staggered *f = &sim->staggered;
    const int o = pass->blocks[index];
    const gs4i_frame frame = gs4i_tile_frame(&sim->grid, sim->grid.occupied_block[o]);
    gs4i_report *report = &sim->reports[o];
    gs4i_face_tile tile[4];
    size_t i = (size_t)sim->grid.first[o], end = (size_t)sim->grid.first[o + 1];
    int c;
    gs4i_report_clear(report);
    report->rows = 0;
    memset(tile, 0, sizeof tile);
    for (; i < end; i += GS4I_BATCH) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s[4];
        gs4i_face_gifts gifts;
        int b;
        gs4i_stage_faces(sim, &frame, i, n, &q, s);
        gs4i_give_to_faces(sim, i, n, &q, s, &gifts);
        for (b = 0; b < n; b++) {
            if (!gs4i_is_in_tiles(s, b)) {
                report->left_tile++;
                continue;
            }
            gs4i_scatter_quad(tile[0], &s[0], b, gifts.cells + 4 * b);
            report->rows |= gs4i_touched_rows(s[0].base[b]);
            for (c = 0; c < 3; c++) {
                gs4i_scatter_affine(tile[1 + c], &s[1 + c], b, &gifts.faces[c]);
                report->rows |= gs4i_touched_rows(s[1 + c].base[b]);
            }
        }
    }
    gs4i_add_face_tile(sim, o, GS4I_AT_CELL, 4, tile[0], f->cell);
    for (c = 0; c < 3; c++) gs4i_add_face_tile(sim, o, 1 << c, 4, tile[1 + c], f->given[c]);
}

/* --- faces ------------------------------------------------------------------------------------ */

/* One plane of faces, or of cells, for gs4i_parallel_for: z runs over one more than cells. */
typedef struct gs4i_staggered_pass {
    gs4_sim *sim;
    gs4_real lightest; /* kg: faces with less are empty */
    int layer, what;   /* of extrapolation; which of the numbers taken */
    int numbers;       /* of those taken, how many are extrapolated */
    gs4_real scale;
} gs4i_staggered_pass;

#define GS4I_EACH_FACE(f, c, z, at, i)                 \
    if ((z) < gs4i_box_length(&(f)->box, 1 << (c), 2)) \
        GS4I_BOX_PLANE(&(f)->box, 1 << (c), z, at, i)

/* v_i, P a and the density of the material, of one plane. */
static void gs4i_face_velocities(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    int c, at[3];
    size_t i;
    for (c = 0; c < 3; c++)
        GS4I_EACH_FACE(f, c, z, at, i) {
            gs4_real *q = f->given[c] + 4 * i;
            const gs4_real m = q[GS4I_FACE_MASS];
            const gs4_real inverse = m > pass->lightest ? 1 / m : GS4I_C(0);
            q[GS4I_FACE_VELOCITY] *= inverse;
            q[GS4I_FACE_RATE] *= inverse;
            q[GS4I_FACE_DENSITY] = inverse > 0 ? m / q[GS4I_FACE_DENSITY] : GS4I_C(0);
        }
}

/* The face of axis c before a node: its remembered acceleration is number c there. */
static const gs4_real *gs4i_remembered_of_face(const gs4_sim *sim, const int at[3], int c)
{
    const gs4i_grid *g = &sim->grid;
    const gs4i_box *box = &sim->staggered.box;
    int64_t node;
    int a, x[3];
    for (a = 0; a < 3; a++) {
        x[a] = at[a] + box->low[a];
        if (at[a] >= box->size[a]) return NULL;
    }
    node = gs4i_node_at(g, x[0], x[1], x[2]);
    return node >= 0 && (g->flags[node] & 1 << c) ? gs4i_of_node(g->remembered, (uint32_t)node) + c
                                                  : NULL;
}

/* ag, which faces without one take from the particles; v** = v_i - s ag; the first guess of u~:
 * v** + s (forces of stress over mass + g). */
static void gs4i_predict_faces(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4_sim *sim = pass->sim;
    gs4i_staggered *f = &sim->staggered;
    const gs4i_integrator *r = &sim->integrator;
    const gs4_real gravity[3] = { sim->desc.gravity.x, sim->desc.gravity.y, sim->desc.gravity.z };
    int c, at[3];
    size_t i;
    for (c = 0; c < 3; c++)
        GS4I_EACH_FACE(f, c, z, at, i) {
            gs4_real *q = f->given[c] + 4 * i, *t = f->taken[c] + 4 * i;
            const gs4_real m = q[GS4I_FACE_MASS], *ag = gs4i_remembered_of_face(sim, at, c);
            gs4_real acc = gravity[c];
            if (f->force[c] && m > pass->lightest) acc = f->force[c][i] / m + acc;
            if (ag && !f->is_plain) q[GS4I_FACE_RATE] = *ag;
            if (r->restart) q[GS4I_FACE_RATE] = 0;
            f->seen[c][i] = q[GS4I_FACE_VELOCITY];
            q[GS4I_FACE_VELOCITY] -= r->s * q[GS4I_FACE_RATE];
            t[GS4I_FACE_STAGE] = q[GS4I_FACE_VELOCITY] + r->s * acc;
            t[GS4I_FACE_ACCELERATION] = acc;
            t[GS4I_FACE_FEEDBACK] = t[GS4I_FACE_CORRECTION] = 0;
            f->known[c][i] = GS4I_FACE_UNKNOWN;
        }
}

/* --- bodies ----------------------------------------------------------------------------------- */

/* Area of a unit square where a distance is positive that is d at its corners, in turn, and linear
 * along its edges. */
static gs4_real gs4i_open_area(const gs4_real d[4])
{
    static const gs4_real corner[5][2] = { { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 }, { 0, 0 } };
    gs4_real x[8][2], area = 0;
    int i, n = 0, k;
    for (i = 0; i < 4; i++) {
        const gs4_real here = d[i], next = d[(i + 1) & 3];
        if (here > 0) {
            x[n][0] = corner[i][0];
            x[n++][1] = corner[i][1];
        }
        if ((here > 0) != (next > 0))
            for (k = 0, n++; k < 2; k++)
                x[n - 1][k] =
                    corner[i][k] + here / (here - next) * (corner[i + 1][k] - corner[i][k]);
    }
    for (i = 0; i < n; i++) {
        const gs4_real *a = x[i], *b = x[(i + 1) % n];
        area += GS4I_C(0.5) * (a[0] * b[1] - b[0] * a[1]);
    }
    return area;
}

/* How much of face c before a node is outside of a slippery body. */
static gs4_real gs4i_open_share(const gs4i_collider *b, gs4_vec3 centre, int c, gs4_real h)
{
    gs4_real d[4], x[3];
    int i;
    for (i = 0; i < 4; i++) {
        x[0] = centre.x;
        x[1] = centre.y;
        x[2] = centre.z;
        x[(c + 1) % 3] += (i == 0 || i == 3 ? -GS4I_C(0.5) : GS4I_C(0.5)) * h;
        x[(c + 2) % 3] += (i < 2 ? -GS4I_C(0.5) : GS4I_C(0.5)) * h;
        d[i] = gs4i_collider_distance(b, gs4i_vec3(x[0], x[1], x[2]));
    }
    return gs4i_open_area(d);
}

/* Share of a kernel (quadratic B-spline) behind a plane that is d cells from its centre. */
static gs4_real gs4i_share_behind(gs4_real d)
{
    const gs4_real t = gs4i_min(gs4i_abs(d), GS4I_C(1.5)), u = GS4I_C(1.5) - t;
    const gs4_real z =
        t <= GS4I_C(0.5) ? GS4I_C(0.75) * t - t * t * t / 3 : GS4I_C(0.5) - u * u * u / 6;
    return d < 0 ? GS4I_C(0.5) + z : GS4I_C(0.5) - z;
}

static gs4_real gs4i_axis_of(gs4_vec3 v, int c) { return c == 0 ? v.x : c == 1 ? v.y : v.z; }

/* One body at one face: sticky ones and emitters hold it where its centre is inside, slippery ones
 * close what is inside. */
static void gs4i_body_at_face(gs4i_staggered *f, const gs4i_grid *g, const gs4i_collider *b,
                              const int node[3], int c, size_t face)
{
    const gs4_vec3 centre = gs4i_place_position(g, node, 1 << c);
    const gs4_vec3 turn = b->is.angular_velocity;
    gs4_vec3 r;
    gs4_real open;
    if (b->is_emitter || gs4i_is_sticky(b))
        open = gs4i_collider_distance(b, centre) < 0 ? GS4I_C(0) : GS4I_C(1);
    else
        open = gs4i_open_share(b, centre, c, g->h);
    if (open >= f->open[c][face]) return;
    f->open[c][face] = open < GS4I_C(0.01) ? GS4I_C(0) : open;
    f->held[c][face] = b->is_emitter || gs4i_is_sticky(b);
    r = gs4i_sub(centre, gs4i_vec3(GS4I_C(b->at[0]), GS4I_C(b->at[1]), GS4I_C(b->at[2])));
    f->body[c][2 * face] = gs4i_axis_of(gs4i_collider_velocity(b, centre), c);
    f->body[c][2 * face + 1] = gs4i_axis_of(gs4i_cross(turn, gs4i_cross(turn, r)), c);
}

/* All bodies on the faces and cells of one block with nodes. */
static void gs4i_bodies_at_block(gs4_sim *sim, int slot)
{
    gs4i_staggered *f = &sim->staggered;
    const gs4i_grid *g = &sim->grid;
    int first[3], x[3], at[3], n, i, c;
    gs4i_block_origin(g, g->block[slot], first);
    for (n = 0; n < sim->boundary.collider_count; n++) {
        const gs4i_collider *b = &sim->boundary.colliders[n];
        if (b->is_off || !gs4i_collider_is_near(b, g, slot)) continue;
        for (i = 0; i < GS4I_BLOCK_NODES; i++) {
            size_t cell;
            gs4i_node_coordinates(first, i, x);
            for (c = 0; c < 3; c++) at[c] = x[c] - f->box.low[c];
            cell = gs4i_box_index(&f->box, GS4I_AT_CELL, at[0], at[1], at[2]);
            if (!b->is_emitter) {
                const gs4_vec3 p = gs4i_place_position(g, x, GS4I_AT_CELL);
                f->cell[4 * cell + GS4I_CELL_SOLID] =
                    gs4i_max(f->cell[4 * cell + GS4I_CELL_SOLID],
                             gs4i_share_behind(gs4i_collider_distance(b, p) * g->inv_h));
            }
            for (c = 0; c < 3; c++)
                gs4i_body_at_face(f, g, b, x, c,
                                  gs4i_box_index(&f->box, 1 << c, at[0], at[1], at[2]));
        }
    }
}

static void gs4i_bodies_at_group(int index, void *context)
{
    gs4_sim *sim = ((const gs4i_node_pass *)context)->sim;
    int s;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(&sim->grid, index); s++)
        gs4i_bodies_at_block(sim, s);
}

/* Where bodies are, and what they do to v_i. */
static void gs4i_place_bodies(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_staggered *f = &sim->staggered;
    int c;
    size_t i;
    if (!f->open[0]) return;
    for (c = 0; c < 3; c++)
        for (i = 0; i < gs4i_box_count(&f->box, 1 << c); i++) {
            f->open[c][i] = 1;
            f->held[c][i] = 0;
            f->body[c][2 * i] = f->body[c][2 * i + 1] = 0;
        }
    gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_bodies_at_group, nodes);
    for (c = 0; c < 3; c++)
        for (i = 0; i < gs4i_box_count(&f->box, 1 << c); i++)
            if (f->held[c][i]) f->given[c][4 * i + GS4I_FACE_VELOCITY] = f->body[c][2 * i];
    gs4i_wrap_faces(sim, f->given, 4);
    gs4i_wrap_faces(sim, f->open, 1);
    gs4i_wrap_faces(sim, f->body, 2);
    gs4i_wrap_bytes(sim, f->held);
    gs4i_wrap_cells(sim, f->cell, 4);
}

/* --- where the surface is --------------------------------------------------------------------- */

/* Depth (cells) under the surface of a half space that fills a quadratic B-spline by 1/2 + z;
 * negative outside. The inverse of z(t) = 3t/4 - t^3/3 for t <= 1/2, else 1/2 - (3/2 - t)^3/6; 3/2
 * beyond. */
static gs4_real gs4i_depth_of_fill(gs4_real z)
{
    const gs4_real size = gs4i_abs(z);
    gs4_real low = 0, high = GS4I_C(1.5);
    int i;
    for (i = 0; i < 30 && size < GS4I_C(0.5); i++) {
        const gs4_real t = GS4I_C(0.5) * (low + high), u = GS4I_C(1.5) - t;
        const gs4_real there =
            t <= GS4I_C(0.5) ? GS4I_C(0.75) * t - t * t * t / 3 : GS4I_C(0.5) - u * u * u / 6;
        if (there < size)
            low = t;
        else
            high = t;
    }
    low = size < GS4I_C(0.5) ? GS4I_C(0.5) * (low + high) : high;
    return z < 0 ? -low : low;
}

/* A cell is liquid whose kernel is full to this share: where its centre is 0.02 cells deep. With
 * less the matrix would lose its digits to surfaces just above centres. */
#define GS4I_LIQUID_FILL 0.515

/* Distance of the surface from the liquid cell's centre, in cells: p is 0 there. */
static gs4_real gs4i_surface_weight(gs4_real liquid, gs4_real air)
{
    const gs4_real in = gs4i_depth_of_fill(liquid - GS4I_C(0.5)),
                   out = gs4i_depth_of_fill(air - GS4I_C(0.5));
    return in / (in - out);
}

/* What a cell behind a side of the domain is that would be `kind`: solid where a wall holds, air
 * where one has let go. */
static uint8_t gs4i_kind_behind(const gs4_sim *sim, int side, const int at[3], uint8_t kind)
{
    const gs4i_staggered *f = &sim->staggered;
    if (sim->desc.walls[side] == GS4_WALL_OPEN || f->box.periodic[side / 2]) return kind;
    if (gs4i_wall_holds(sim, side, GS4I_AT_CELL, at)) return GS4_CELL_SOLID;
    return (uint8_t)(kind == GS4_CELL_SOLID ? GS4_CELL_SOLID : GS4_CELL_AIR);
}

/* Liquid where material fills more than half of the kernel. */
static void gs4i_classify_cells(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    const gs4i_grid *g = &pass->sim->grid;
    const gs4_real per_cell = g->inv_h * g->inv_h * g->inv_h;
    int at[3], a;
    size_t i;
    GS4I_BOX_PLANE(&f->box, GS4I_AT_CELL, z, at, i) {
        gs4_real *q = f->cell + 4 * i;
        if (q[GS4I_CELL_FILL] > 0) {
            q[GS4I_CELL_COMPLIANCE] /= q[GS4I_CELL_FILL];
            q[GS4I_CELL_DILATION] /= q[GS4I_CELL_FILL];
        }
        q[GS4I_CELL_FILL] *= per_cell;
        if (q[GS4I_CELL_SOLID] > 0)
            q[GS4I_CELL_FILL] /= gs4i_max(1 - q[GS4I_CELL_SOLID], GS4I_C(0.05));
        f->kind[i] = q[GS4I_CELL_FILL] > GS4I_C(GS4I_LIQUID_FILL) ? GS4_CELL_LIQUID : GS4_CELL_AIR;
        if (q[GS4I_CELL_SOLID] > GS4I_C(0.95)) f->kind[i] = GS4_CELL_SOLID;
        f->diagonal[i] = q[GS4I_CELL_COMPLIANCE] / pass->sim->integrator.s;
        f->pressure[i] = 0;
        for (a = 0; a < 3; a++)
            if (at[a] < f->from[a] || at[a] >= f->to[a])
                f->kind[i] =
                    gs4i_kind_behind(pass->sim, 2 * a + (at[a] >= f->to[a]), at, f->kind[i]);
    }
}

/* The cells behind and before a face of axis c that is not at an end of the box. */
GS4I_INLINE size_t gs4i_cells_of_face(const gs4i_box *box, int c, const int at[3], size_t *before)
{
    const size_t row = (size_t)box->size[0],
                 cell = gs4i_box_index(box, GS4I_AT_CELL, at[0], at[1], at[2]);
    *before = cell - (c == 0 ? 1 : c == 1 ? row : row * (size_t)box->size[1]);
    return cell;
}

/* A face that a wall or a body moves. */
GS4I_INLINE void gs4i_hold_face(gs4i_staggered *f, int c, size_t face, gs4_real velocity,
                                gs4_real acceleration)
{
    f->known[c][face] = GS4I_FACE_AT_WALL;
    f->taken[c][4 * face + GS4I_FACE_GUESS] = f->taken[c][4 * face + GS4I_FACE_STAGE];
    f->taken[c][4 * face + GS4I_FACE_STAGE] = velocity;
    f->taken[c][4 * face + GS4I_FACE_ACCELERATION] = acceleration;
}

/* Which faces are unknowns, with c = open s/(w rho) of the pressure's matrix. */
static void gs4i_classify_face(const gs4_sim *sim, gs4i_staggered *f, int c, const int at[3],
                               size_t i)
{
    const gs4i_box *box = &f->box;
    const gs4_real s = sim->integrator.s;
    gs4_real *q = f->given[c] + 4 * i, w = 1;
    size_t cell, before;
    int kind, kind_before;
    f->reach[c][i] = 0;
    if (at[c] == 0 || at[c] == box->size[c]) return;
    if (!box->periodic[c]
        && ((at[c] == f->from[c] && gs4i_has_wall(sim, 2 * c)
             && gs4i_wall_holds(sim, 2 * c, 1 << c, at))
            || (at[c] == f->to[c] && gs4i_has_wall(sim, 2 * c + 1)
                && gs4i_wall_holds(sim, 2 * c + 1, 1 << c, at)))) {
        gs4i_hold_face(f, c, i, 0, 0);
        return;
    }
    if (f->open[c] && f->held[c][i]) {
        gs4i_hold_face(f, c, i, f->body[c][2 * i], f->body[c][2 * i + 1]);
        return;
    }
    cell = gs4i_cells_of_face(box, c, at, &before);
    kind = f->kind[cell];
    kind_before = f->kind[before];
    if (f->open[c] && (kind == GS4_CELL_SOLID || kind_before == GS4_CELL_SOLID)) f->open[c][i] = 0;
    if ((kind != GS4_CELL_LIQUID && kind_before != GS4_CELL_LIQUID) || kind == GS4_CELL_SOLID
        || kind_before == GS4_CELL_SOLID || (f->open[c] && !(f->open[c][i] > 0)))
        return;
    if (kind != kind_before)
        w = kind == GS4_CELL_LIQUID ? gs4i_surface_weight(f->cell[4 * cell], f->cell[4 * before])
                                    : gs4i_surface_weight(f->cell[4 * before], f->cell[4 * cell]);
    q[GS4I_FACE_DENSITY] *= w;
    f->known[c][i] = GS4I_FACE_SOLVED;
    f->reach[c][i] = s / q[GS4I_FACE_DENSITY] * (f->open[c] ? f->open[c][i] : 1);
}

static void gs4i_classify_faces(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    int c, at[3];
    size_t i;
    for (c = 0; c < 3; c++)
        GS4I_EACH_FACE(f, c, z, at, i) gs4i_classify_face(pass->sim, f, c, at, i);
}

/* --- the solves ------------------------------------------------------------------------------- */

/* Number `what` of a face, of which a body closes a part. */
GS4I_INLINE gs4_real gs4i_flow_through(const gs4i_staggered *f, int what, int c, size_t face)
{
    const gs4_real own = f->taken[c][4 * face + (size_t)what];
    if (!f->open[c] || !(f->open[c][face] < 1) || f->held[c][face]) return own;
    return f->open[c][face] * own
           + (what == GS4I_FACE_CORRECTION
                  ? GS4I_C(0)
                  : (1 - f->open[c][face])
                        * f->body[c][2 * face + (what == GS4I_FACE_ACCELERATION)]);
}

/* Differences of number `what` of the six faces of a cell, times 1/h. */
static gs4_real gs4i_face_divergence(const gs4i_staggered *f, int what, const int at[3],
                                     gs4_real inv_h)
{
    size_t face[6];
    gs4_real sum = 0;
    int c;
    gs4i_box_faces_of(&f->box, at, face);
    for (c = 0; c < 3; c++)
        sum += gs4i_flow_through(f, what, c, face[2 * c + 1])
               - gs4i_flow_through(f, what, c, face[2 * c]);
    return inv_h * sum;
}

/* tr(L L) at a cell, L the gradient of u~: the divergence of the acceleration of a flow that stays
 * solenoidal. */
static gs4_real gs4i_trace_of_square(const gs4i_staggered *f, const int at[3], gs4_real inv_h)
{
    gs4_real L[3][3], sum = 0;
    int c, a;
    for (c = 0; c < 3; c++) {
        const int place = 1 << c;
        const size_t low = gs4i_box_index(&f->box, place, at[0], at[1], at[2]);
        const size_t nx = (size_t)gs4i_box_length(&f->box, place, 0),
                     step[3] = { 1, nx, nx * (size_t)gs4i_box_length(&f->box, place, 1) };
        const gs4_real *u = f->taken[c];
        for (a = 0; a < 3; a++) {
            const size_t up = low + step[c];
            if (a == c)
                L[c][a] = inv_h * (u[4 * up] - u[4 * low]);
            else
                L[c][a] = GS4I_C(0.25) * inv_h
                          * ((u[4 * (low + step[a])] - u[4 * (low - step[a])])
                             + (u[4 * (up + step[a])] - u[4 * (up - step[a])]));
        }
    }
    for (c = 0; c < 3; c++)
        for (a = 0; a < 3; a++) sum += L[c][a] * L[a][c];
    return sum;
}

/* Right-hand sides: what the solve has to take from the divergence of a number of the faces. */
static void gs4i_pressure_rhs(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    const gs4_real inv_h = pass->sim->grid.inv_h;
    int at[3];
    size_t i;
    GS4I_BOX_PLANE(&f->box, GS4I_AT_CELL, z, at, i) {
        f->pressure[i] = 0;
        f->rhs[i] = 0;
        if (f->kind[i] != GS4_CELL_LIQUID || gs4i_is_copy(f, at)) continue;
        f->rhs[i] = -gs4i_face_divergence(f, pass->what, at, inv_h);
        if (pass->what == GS4I_FACE_ACCELERATION)
            f->rhs[i] += gs4i_trace_of_square(f, at, inv_h);
        else
            f->rhs[i] -= f->cell[4 * i + GS4I_CELL_DILATION] / pass->sim->integrator.s;
    }
}

/* Numbers of the unknown faces += scale c (p before - p behind)/h. */
static void gs4i_apply_pressure(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    const gs4i_box *box = &f->box;
    const gs4_real scale = pass->sim->integrator.s * pass->sim->grid.inv_h;
    int c, at[3];
    size_t i;
    for (c = 0; c < 3; c++)
        GS4I_EACH_FACE(f, c, z, at, i) {
            size_t cell, before;
            if (f->known[c][i] != GS4I_FACE_SOLVED) continue;
            cell = gs4i_cells_of_face(box, c, at, &before);
            f->taken[c][4 * i + (size_t)pass->what] -= scale
                                                       / f->given[c][4 * i + GS4I_FACE_DENSITY]
                                                       * (f->pressure[cell] - f->pressure[before]);
        }
}

/* Copies are air to the preconditioner, and no unknowns. */
static void gs4i_setup_periodic(gs4_sim *sim)
{
    gs4i_staggered *f = &sim->staggered;
    gs4i_elliptic *e = &f->system;
    int z, a, at[3];
    size_t i;
    e->box = &f->box;
    e->tasks = &sim->tasks;
    e->h = sim->grid.h;
    e->inv_h = sim->grid.inv_h;
    e->diagonal = f->diagonal;
    e->rhs = f->rhs;
    e->x = f->pressure;
    e->cycles = 1;
    e->tolerance = (double)sim->desc.solver_tolerance;
    e->max_iterations = sim->desc.solver_max_iterations;
    for (a = 0; a < 3; a++) {
        e->face[a] = f->reach[a];
        e->first[a] = f->first[a];
        e->end[a] = f->end[a];
    }
    for (z = 0; z < f->box.size[2]; z++)
        GS4I_BOX_PLANE(&f->box, GS4I_AT_CELL, z, at, i)
            e->kind[i] = gs4i_is_copy(f, at) ? (uint8_t)GS4_CELL_AIR : f->kind[i];
}

static int gs4i_setup_pressure(gs4_sim *sim)
{
    gs4i_staggered *f = &sim->staggered;
    gs4_poisson_desc d;
    int a, result;
    memset(&d, 0, sizeof d);
    for (a = 0; a < 3; a++) {
        d.cells[a] = f->box.size[a];
        d.coefficient[a] = f->reach[a];
    }
    d.cell_size = sim->grid.h;
    if (gs4i_box_is_periodic(&f->box)) gs4i_setup_periodic(sim);
    d.kind = f->system.kind;
    if (f->compressible) d.diagonal = f->diagonal;
    d.threads = sim->desc.threads;
    d.parallel_for = sim->desc.parallel_for;
    result = gs4i_solver_setup(&f->system.solver, &d);
    if (result == GS4_OK) return result;
    if (result == GS4_ERROR_MEMORY) return gs4i_fail_memory(&sim->error);
    return gs4i_fail_value(&sim->error, GS4_ERROR_UNSTABLE, f->system.solver.fault,
                           f->system.solver.fault_value,
                           " in the pressure of the step, which is not finite or absurd; the step "
                           "was not taken; a smaller dt would do");
}

/* Solve for the right-hand side that is there, and take the gradient over the density from the
 * number of the faces that `pass` says. */
static int gs4i_solve_pressure(gs4_sim *sim, gs4i_staggered_pass *pass)
{
    gs4i_staggered *f = &sim->staggered;
    gs4_solve_stats stats;
    int result;
    memset(&stats, 0, sizeof stats);
    if (gs4i_box_is_periodic(&f->box)) {
        f->system.iterations = 0;
        result = gs4i_solve_periodic(&f->system);
        stats.iterations = f->system.iterations;
        stats.residual = f->system.residual;
        gs4i_wrap_cells(sim, f->pressure, 1);
    } else
        result = gs4i_solver_solve(&f->system.solver, f->rhs, f->pressure,
                                   (double)sim->desc.solver_tolerance,
                                   sim->desc.solver_max_iterations, &stats);
    f->iterations += stats.iterations;
    f->residual = fmax(f->residual, stats.residual);
    if (result == GS4_ERROR_NOT_CONVERGED)
        return gs4i_fail_value(
            &sim->error, result, "the pressure of the step did not converge: the residual is ",
            stats.residual,
            " of the divergence (solver_tolerance, solver_max_iterations); the step was not "
            "taken; a larger tolerance, more iterations or a smaller dt would do");
    if (result != GS4_OK)
        return gs4i_fail_value(&sim->error, GS4_ERROR_UNSTABLE, f->system.solver.fault,
                               f->system.solver.fault_value,
                               " in the pressure of the step, which is not finite or absurd; the "
                               "step was not taken; a smaller dt would do");
    gs4i_parallel_for(&sim->tasks, f->box.size[2] + 1, gs4i_apply_pressure, pass);
    return GS4_OK;
}

/* The fastest face (m/s); infinity where something is not finite. */
static gs4_real gs4i_fastest_face(const gs4i_staggered *f)
{
    gs4_real most = 0;
    int c;
    size_t i;
    for (c = 0; c < 3; c++)
        for (i = 0; i < gs4i_box_count(&f->box, 1 << c); i++)
            if (f->known[c][i]) {
                const gs4_real *t = f->taken[c] + 4 * i;
                if (!gs4i_finite(t[0] + t[1] + t[2])) return GS4I_HUGE;
                most = gs4i_max(most, gs4i_abs(t[GS4I_FACE_STAGE]));
            }
    return most;
}

/* Where no cell is air nothing may flow into the liquid in all, unless it compresses. */
static int gs4i_check_inflow(gs4_sim *sim)
{
    const gs4i_staggered *f = &sim->staggered;
    double inflow = 0, liquid = 0;
    gs4_real fastest = 0;
    size_t i;
    int n;
    if (f->compressible) return GS4_OK;
    for (i = 0; i < gs4i_box_count(&f->box, GS4I_AT_CELL); i++) {
        if (f->kind[i] == GS4_CELL_AIR) return GS4_OK;
        if (f->system.kind[i] == GS4_CELL_LIQUID) {
            inflow += (double)f->rhs[i];
            liquid++;
        }
    }
    for (n = 0; n < sim->boundary.collider_count; n++)
        fastest = gs4i_max(fastest, gs4i_collider_speed(&sim->boundary.colliders[n], &sim->grid));
    fastest = gs4i_max(fastest, gs4i_fastest_face(f));
    /* rounding gives 1e-6 of U/h; a piston that crosses a box of 1000 cells 1e-3 */
    if (liquid < 1 || fabs(inflow) <= 1e-4 * liquid * (double)(fastest * sim->grid.inv_h))
        return GS4_OK;
    return gs4i_fail_value(&sim->error, GS4_ERROR_UNSTABLE,
                           "the closed space is full of incompressible liquid, and its walls or "
                           "colliders would take a share of ",
                           inflow / liquid * (double)sim->integrator.dt,
                           " of it in a step; the step was not taken; a bulk_modulus, an open wall "
                           "or some air would do");
}

/* Take from number `what` of the faces a gradient over the density, so that its divergence is what
 * gs4i_pressure_rhs says. */
static int gs4i_project(gs4_sim *sim, int what)
{
    gs4i_staggered *f = &sim->staggered;
    gs4i_staggered_pass pass;
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    pass.what = what;
    gs4i_parallel_for(&sim->tasks, f->box.size[2], gs4i_pressure_rhs, &pass);
    /* what can let go is looked at when it has */
    if (what == GS4I_FACE_STAGE && !f->contact) GS4I_TRY(gs4i_check_inflow(sim));
    return gs4i_solve_pressure(sim, &pass);
}

/* --- what separates --------------------------------------------------------------------------- */

/* A column of cells at a wall that separates: its last cell, the wall's face there, the node
 * behind. */
typedef struct gs4i_wall_column {
    size_t cell, face;
    int node[3];
} gs4i_wall_column;

static gs4i_wall_column gs4i_column_at(const gs4i_staggered *f, int side, int at[3])
{
    const int a = side / 2, high = side & 1;
    gs4i_wall_column w;
    int t;
    at[a] = high ? f->to[a] - 1 : f->from[a];
    w.cell = gs4i_box_index(&f->box, GS4I_AT_CELL, at[0], at[1], at[2]);
    at[a] += high;
    w.face = gs4i_box_index(&f->box, 1 << a, at[0], at[1], at[2]);
    for (t = 0; t < 3; t++) w.node[t] = at[t] + f->box.low[t] - (t == a && !high);
    return w;
}

/* All columns w, at at[], of a side. */
#define GS4I_EACH_COLUMN(f, side, at, b, c, w)                                       \
    for ((b) = (side) / 2 == 0, (c) = 3 - (side) / 2 - (b), (at)[c] = (f)->first[c]; \
         (at)[c] < (f)->end[c]; (at)[c]++)                                           \
        for ((at)[b] = (f)->first[b];                                                \
             (at)[b] < (f)->end[b] && ((w) = gs4i_column_at((f), (side), (at)), 1); (at)[b]++)

/* Did material press on the wall before this node in the last step? */
static int gs4i_was_pressed(const gs4i_grid *g, const int x[3])
{
    const int64_t node = gs4i_node_at(g, x[0], x[1], x[2]);
    return node >= 0 && (g->flags[node] & GS4I_WAS_PRESSED) != 0;
}

/* What is likely in contact: where material moves into a wall or pressed on it; at first all. */
static void gs4i_guess_contact(gs4_sim *sim)
{
    gs4i_staggered *f = &sim->staggered;
    gs4i_wall_column w;
    int side, at[3], b, c;
    if (!f->contact) return;
    memset(f->contact, 0, gs4i_box_count(&f->box, GS4I_AT_CELL));
    for (side = 0; side < 6; side++)
        if (sim->desc.walls[side] == GS4_WALL_SEPARATE && gs4i_has_wall(sim, side))
            GS4I_EACH_COLUMN(f, side, at, b, c, w) {
                const gs4_real into =
                    GS4I_C(side & 1 ? 1 : -1) * f->given[side / 2][4 * w.face + GS4I_FACE_VELOCITY];
                if ((sim->integrator.restart && into >= 0) || into > 0
                    || gs4i_was_pressed(&sim->grid, w.node))
                    f->contact[w.cell] |= (uint8_t)(1 << side);
            }
}

/* How fast (m/s) the face would move into the wall if no pressure were on the wall: of a face that
 * is held by what it was to have, and the pressure of the cell, half a cell before it. More than 0:
 * the wall pushes, viscous stress included. */
static gs4_real gs4i_speed_into_wall(const gs4_sim *sim, int side, const gs4i_wall_column *w)
{
    const gs4i_staggered *f = &sim->staggered;
    const gs4_real outward = GS4I_C(side & 1 ? 1 : -1), *t = f->taken[side / 2] + 4 * w->face,
                   density = f->given[side / 2][4 * w->face + GS4I_FACE_DENSITY];
    if (!(f->contact[w->cell] >> side & 1)) return outward * t[GS4I_FACE_STAGE];
    if (!(density > 0)) return 0;
    return outward * t[GS4I_FACE_GUESS]
           + 2 * sim->integrator.s * sim->grid.inv_h * f->pressure[w->cell] / density;
}

/* Should the wall hold what flies by itself in a column? Where it moves into the wall, and beside
 * liquid that the wall holds, so that a surface sees the same wall on both sides of it. */
static int gs4i_should_hold(const gs4i_staggered *f, int side, const gs4i_wall_column *w,
                            const int at[3])
{
    const gs4_real outward = GS4I_C(side & 1 ? 1 : -1);
    int t, k, p[3], any = outward * f->seen[side / 2][w->face] > 0;
    for (t = 0; t < 3; t++)
        for (k = -1; k <= 1 && t != side / 2; k += 2) {
            gs4i_wall_column beside;
            memcpy(p, at, sizeof p);
            p[t] = gs4i_around(f, t, p[t] + k);
            if (p[t] < 0 || p[t] >= f->box.size[t]) continue;
            beside = gs4i_column_at(f, side, p);
            any |= f->kind[beside.cell] == GS4_CELL_LIQUID && (f->contact[beside.cell] >> side & 1);
        }
    return any;
}

/* By what the solve found walls let go of cells that they would have to pull, and hold those that
 * move into them; at `last` they only hold. First cells of liquid, then the others. How many
 * changed. What the solver leaves undone is no reason. */
static int gs4i_revise_contact(gs4_sim *sim, int last)
{
    gs4i_staggered *f = &sim->staggered;
    const gs4_real least =
        10 * gs4i_max(sim->desc.solver_tolerance, GS4I_EPSILON) * gs4i_fastest_face(f);
    gs4i_wall_column w;
    int n, at[3], b, c, changed = 0;
    for (n = 0; n < 12; n++) {
        const int side = n % 6, liquid = n < 6;
        if (sim->desc.walls[side] != GS4_WALL_SEPARATE || !gs4i_has_wall(sim, side)) continue;
        GS4I_EACH_COLUMN(f, side, at, b, c, w) {
            const int holds = f->contact[w.cell] >> side & 1;
            int should;
            if ((f->kind[w.cell] == GS4_CELL_LIQUID) != liquid) continue;
            should = liquid ? gs4i_speed_into_wall(sim, side, &w) > (holds ? -least : least)
                            : gs4i_should_hold(f, side, &w, at);
            if (holds == should || (last && holds)) continue;
            f->contact[w.cell] ^= (uint8_t)(1 << side);
            changed++;
        }
    }
    return changed;
}

/* Is anything held by its impact alone, not by what accelerates it? With `pressure` what the split
 * found beside that of u~. */
static int gs4i_is_impact(const gs4_sim *sim)
{
    const gs4i_staggered *f = &sim->staggered;
    gs4i_wall_column w;
    int side, at[3], b, c, any = 0;
    for (side = 0; side < 6 && f->contact; side++)
        if (sim->desc.walls[side] == GS4_WALL_SEPARATE && gs4i_has_wall(sim, side))
            GS4I_EACH_COLUMN(f, side, at, b, c, w) {
                const gs4_real *q = f->given[side / 2] + 4 * w.face,
                               outward = GS4I_C(side & 1 ? 1 : -1);
                gs4_real acc = gs4i_axis_of(sim->desc.gravity, side / 2), p;
                if (f->kind[w.cell] != GS4_CELL_LIQUID || !(f->contact[w.cell] >> side & 1)
                    || !(q[GS4I_FACE_MASS] > 0))
                    continue;
                if (f->force[side / 2]) acc += f->force[side / 2][w.face] / q[GS4I_FACE_MASS];
                p = f->cell[4 * w.cell + GS4I_CELL_PRESSURE]
                    + sim->integrator.s * f->pressure[w.cell];
                any |= outward * acc + 2 * sim->grid.inv_h * p / q[GS4I_FACE_DENSITY] < 0;
            }
    return any;
}

/* --- extrapolation ---------------------------------------------------------------------------- */

/* An unknown face of axis c beside known ones: 2 u1 - u2 along the directions with two, else the
 * mean of those with one. */
GS4I_INLINE void gs4i_extrapolate_face(const gs4i_staggered_pass *pass, int c, const int at[3],
                                       const ptrdiff_t step[3], size_t i)
{
    gs4i_staggered *f = &pass->sim->staggered;
    const uint8_t *known = f->known[c];
    gs4_real *u = f->taken[c];
    gs4_real two[4] = { 0, 0, 0, 0 }, one[4] = { 0, 0, 0, 0 };
    int twos = 0, ones = 0, side, k;
    for (side = 0; side < 6; side++) {
        const int a = side / 2, last = f->to[a] - (a != c);
        const int room = f->box.periodic[a] ? 2 : side & 1 ? last - at[a] : at[a] - f->from[a];
        const ptrdiff_t d = side & 1 ? step[a] : -step[a], n1 = (ptrdiff_t)i + d, n2 = n1 + d;
        if (room < 1 || !known[n1] || known[n1] >= pass->layer) continue;
        for (k = 0; k < pass->numbers; k++) one[k] += u[4 * n1 + k];
        ones++;
        if (room < 2 || !known[n2] || known[n2] >= pass->layer) continue;
        for (k = 0; k < pass->numbers; k++) two[k] += 2 * u[4 * n1 + k] - u[4 * n2 + k];
        twos++;
    }
    if (!ones) return;
    for (k = 0; k < pass->numbers; k++)
        u[4 * i + (size_t)k] = twos ? two[k] / GS4I_C(twos) : one[k] / GS4I_C(ones);
    f->known[c][i] = (uint8_t)pass->layer;
}

/* Is any face of axis c known in row (y, z), or in the rows beside it? */
static int gs4i_is_known_near(const gs4i_staggered *f, int c, int y, int z)
{
    const int nx = gs4i_box_length(&f->box, 1 << c, 0);
    int side, x, any = 0;
    for (side = 0; side < 5; side++) {
        const int b = y + (side == 1) - (side == 2), d = z + (side == 3) - (side == 4);
        const uint8_t *known;
        if (b < 0 || b >= gs4i_box_length(&f->box, 1 << c, 1)) continue;
        if (d < 0 || d >= gs4i_box_length(&f->box, 1 << c, 2)) continue;
        known = f->known[c] + gs4i_box_index(&f->box, 1 << c, 0, b, d);
        for (x = 0; x < nx; x++) any |= known[x];
    }
    return any;
}

static void gs4i_extrapolate_layer(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    const gs4i_staggered *f = &pass->sim->staggered;
    int c, at[3];
    for (c = 0; c < 3; c++) {
        const ptrdiff_t nx = gs4i_box_length(&f->box, 1 << c, 0),
                        step[3] = { 1, nx, nx * gs4i_box_length(&f->box, 1 << c, 1) };
        at[2] = z;
        if (z < f->from[2] || z >= f->to[2] + (c == 2)) continue;
        for (at[1] = f->from[1]; at[1] < f->to[1] + (c == 1); at[1]++) {
            const size_t row = gs4i_box_index(&f->box, 1 << c, 0, at[1], z);
            if (!gs4i_is_known_near(f, c, at[1], z)) continue;
            for (at[0] = f->from[0]; at[0] < f->to[0] + (c == 0); at[0]++)
                if (!f->known[c][row + (size_t)at[0]])
                    gs4i_extrapolate_face(pass, c, at, step, row + (size_t)at[0]);
        }
    }
}

/* The first `numbers` from the known faces to those around and behind the walls. */
static void gs4i_extrapolate(gs4_sim *sim, int numbers)
{
    gs4i_staggered_pass pass;
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    pass.numbers = numbers;
    for (pass.layer = GS4I_FACE_LAYER; pass.layer < GS4I_FACE_LAYER + GS4I_FACE_LAYERS;
         pass.layer++) {
        gs4i_parallel_for(&sim->tasks, sim->staggered.box.size[2] + 1, gs4i_extrapolate_layer,
                          &pass);
        gs4i_wrap_faces(sim, sim->staggered.taken, 4);
        gs4i_wrap_bytes(sim, sim->staggered.known);
    }
}

/* The pressure that the solve found, for particles to take; not that of cells whose centres are in
 * bodies, where it may be shut in. In the place of the right-hand side, which is done with, which
 * cells know one. */
static void gs4i_keep_pressure(int z, void *context)
{
    gs4i_staggered *f = &((const gs4i_staggered_pass *)context)->sim->staggered;
    int at[3];
    size_t i;
    GS4I_BOX_PLANE(&f->box, GS4I_AT_CELL, z, at, i) {
        const int known =
            f->kind[i] == GS4_CELL_LIQUID && !(f->cell[4 * i + GS4I_CELL_SOLID] > GS4I_C(0.5));
        f->rhs[i] = known ? GS4I_C(GS4I_FACE_SOLVED) : GS4I_C(GS4I_FACE_UNKNOWN);
        f->cell[4 * i + GS4I_CELL_PRESSURE] = known ? f->pressure[i] : GS4I_C(0);
    }
}

/* As gs4i_extrapolate_layer, but air beside a single cell of liquid has none. */
static void gs4i_extrapolate_pressure(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    const int *size = f->box.size;
    const ptrdiff_t step[3] = { 1, size[0], (ptrdiff_t)size[0] * size[1] };
    const gs4_real layer = GS4I_C(pass->layer), *known = f->rhs;
    gs4_real *p = f->cell + GS4I_CELL_PRESSURE;
    int at[3], side;
    size_t i;
    GS4I_BOX_PLANE(&f->box, GS4I_AT_CELL, z, at, i) {
        gs4_real two = 0, one = 0;
        int twos = 0, ones = 0;
        if (known[i] > 0) continue;
        for (side = 0; side < 6; side++) {
            const int a = side / 2, room = side & 1 ? size[a] - 1 - at[a] : at[a];
            const ptrdiff_t d = side & 1 ? step[a] : -step[a], n1 = (ptrdiff_t)i + d, n2 = n1 + d;
            if (room < 1 || !(known[n1] > 0 && known[n1] < layer)) continue;
            one += p[4 * n1];
            ones++;
            if (room < 2 || !(known[n2] > 0 && known[n2] < layer)) continue;
            two += 2 * p[4 * n1] - p[4 * n2];
            twos++;
        }
        if (!ones) continue;
        p[4 * i] = twos                         ? two / GS4I_C(twos)
                   : f->kind[i] == GS4_CELL_AIR ? GS4I_C(0)
                                                : one / GS4I_C(ones);
        f->rhs[i] = layer;
    }
}

static void gs4i_take_pressure(gs4_sim *sim)
{
    const int planes = sim->staggered.box.size[2];
    gs4i_staggered_pass pass;
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    gs4i_parallel_for(&sim->tasks, planes, gs4i_keep_pressure, &pass);
    for (pass.layer = GS4I_FACE_LAYER; pass.layer < GS4I_FACE_LAYER + GS4I_FACE_LAYERS;
         pass.layer++)
        gs4i_parallel_for(&sim->tasks, planes, gs4i_extrapolate_pressure, &pass);
    gs4i_wrap_cells(sim, sim->staggered.cell, 4);
}

/* ==== [[partitioned]] the partitioned scheme: forces, then a projection ======================== *
 *
 * What [[explicit]] is for stress, and pressure from a solve: u~ = v** + s acc has no divergence,
 *
 *     acc = (forces of stress)/m + g - grad p/(w rho),   v** = v_i - s ag                     (P1)
 *
 * p = 0 where the surface is: w is its distance from the liquid cell before it, in cells. That
 * alone does not converge in time: (u~ - v**)/s has the gradient part of what particles gave, times
 * 1/s, and scattering and gathering are not inverse, so it comes back every step. So acc is split:
 *
 *     (u~ - v**)/s = acc + (1/(w rho)) grad phi,   div acc = tr(L L), L = grad u~             (P2)
 *
 * acc makes the rates; feedback theta times the rest moves particles, and no node remembers it,
 * theta = min(1/2, s U/h). Third, positions are corrected once a step so that material fills its
 * cells: x += dt u_c, div u_c = what is too much there, times a rate. */

/* The correction of volume takes at most this share of what is too much in a step. */
#define GS4I_MOST_CORRECTION 0.5

/* --- S4, S5 ----------------------------------------------------------------------------------- */

/* One number a face, of a tile of such. A row of four is loaded where three count. */
typedef gs4_real gs4i_number_tile[GS4I_TILE * GS4I_TILE * GS4I_TILE + 4];

/* The velocity of faces of axis c. */
static void gs4i_load_velocity_tile(const gs4_sim *sim, int o, int c, gs4_real *tile)
{
    const gs4i_staggered *f = &sim->staggered;
    const uint64_t rows = sim->reports[o].rows;
    int first[3], row, x;
    gs4i_block_origin(&sim->grid, sim->grid.occupied_block[o], first);
    memset(tile, 0, sizeof(gs4i_number_tile));
    for (row = 0; row < 64; row++) {
        const gs4_real *from;
        if (!(rows >> row & 1)) continue;
        from = f->given[c] + 4 * gs4i_face_row(f, first, 1 << c, row) + GS4I_FACE_VELOCITY;
        for (x = 0; x < GS4I_TILE; x++) tile[GS4I_TILE * row + x] = from[4 * x];
    }
}

/* sum_i v_i grad w_i of particle n. */
GS4I_INLINE void gs4i_gather_slope(const gs4_real *tile, const gs4i_stencils *s, int n,
                                   gs4_real *dx, gs4_real *dy, gs4_real *dz)
{
    gs4_real plain[4], y[4], z[4];
    gs4i_quad sum, sum_y, sum_z, row, slope, r;
    int j, k;
    tile += s->base[n];
    for (k = 0; k < 3; k++) {
        for (j = 0; j < 3; j++) {
            GS4I_LOAD(r, tile + GS4I_TILE * (GS4I_TILE * k + j));
            if (j == 0) {
                GS4I_SPLAT_MUL(row, GS4I_NTH_CONST(s->w[1][0], n), r);
                GS4I_SPLAT_MUL(slope, GS4I_NTH_CONST(s->d[1][0], n), r);
            } else {
                GS4I_SPLAT_MAD(row, GS4I_NTH_CONST(s->w[1][j], n), r);
                GS4I_SPLAT_MAD(slope, GS4I_NTH_CONST(s->d[1][j], n), r);
            }
        }
        if (k == 0) {
            GS4I_SPLAT_MUL(sum, GS4I_NTH_CONST(s->w[2][0], n), row);
            GS4I_SPLAT_MUL(sum_y, GS4I_NTH_CONST(s->w[2][0], n), slope);
            GS4I_SPLAT_MUL(sum_z, GS4I_NTH_CONST(s->d[2][0], n), row);
        } else {
            GS4I_SPLAT_MAD(sum, GS4I_NTH_CONST(s->w[2][k], n), row);
            GS4I_SPLAT_MAD(sum_y, GS4I_NTH_CONST(s->w[2][k], n), slope);
            GS4I_SPLAT_MAD(sum_z, GS4I_NTH_CONST(s->d[2][k], n), row);
        }
    }
    GS4I_STORE(plain, sum);
    GS4I_STORE(y, sum_y);
    GS4I_STORE(z, sum_z);
    *dx = *dy = *dz = 0;
    for (j = 0; j < 3; j++) {
        *dx += GS4I_NTH_CONST(s->d[0][j], n) * plain[j];
        *dy += GS4I_NTH_CONST(s->w[0][j], n) * y[j];
        *dz += GS4I_NTH_CONST(s->w[0][j], n) * z[j];
    }
}

/* Slopes of velocity, four numbers a particle: its gradient L. */
GS4I_INLINE void gs4i_gather_slopes(gs4i_number_tile tile[3], const gs4i_stencils s[4], int n,
                                    gs4i_gathered *slope)
{
    int b, c;
    memset(slope, 0, sizeof *slope);
    for (b = 0; b < n; b++)
        for (c = 0; c < 3; c++)
            gs4i_gather_slope(tile[c], &s[1 + c], b, &slope->dx[4 * b + c], &slope->dy[4 * b + c],
                              &slope->dz[4 * b + c]);
}

/* These for the next step, and the last ones beside them: the same, where there is none. */
static void gs4i_store_affine(const gs4i_particles *p, size_t i, int n, const gs4i_gathered *slope,
                              int is_first)
{
    int a;
    for (a = 0; a < 3; a++) {
        const gs4_real *now = a == 0 ? slope->dx : a == 1 ? slope->dy : slope->dz;
        memcpy(p->affine_before[a] + 4 * i, is_first ? now : p->affine[a] + 4 * i,
               4 * (size_t)n * sizeof *now);
        memcpy(p->affine[a] + 4 * i, now, 4 * (size_t)n * sizeof *now);
    }
}

/* Single numbers: tile += gx dw/dx + gy dw/dy + gz dw/dz, for particle n of a batch. */
GS4I_INLINE void gs4i_scatter_slope(gs4_real *tile, const gs4i_stencils *s, int n, gs4i_lanes g[3])
{
    const gs4_real x[4] = { GS4I_NTH_CONST(s->w[0][0], n), GS4I_NTH_CONST(s->w[0][1], n),
                            GS4I_NTH_CONST(s->w[0][2], n), 0 },
                   d[4] = { GS4I_NTH_CONST(s->d[0][0], n), GS4I_NTH_CONST(s->d[0][1], n),
                            GS4I_NTH_CONST(s->d[0][2], n), 0 };
    gs4i_quad p0, p1, p2, a, b, r, t;
    int j, k;
    GS4I_LOAD(t, x);
    GS4I_LOAD(p0, d);
    GS4I_SPLAT_MUL(p0, GS4I_NTH_CONST(g[0], n), p0);
    GS4I_SPLAT_MUL(p1, GS4I_NTH_CONST(g[1], n), t);
    GS4I_SPLAT_MUL(p2, GS4I_NTH_CONST(g[2], n), t);
    tile += s->base[n];
    for (j = 0; j < 3; j++) {
        GS4I_SPLAT_MUL(a, GS4I_NTH_CONST(s->w[1][j], n), p0);
        GS4I_SPLAT_MAD(a, GS4I_NTH_CONST(s->d[1][j], n), p1);
        GS4I_SPLAT_MUL(b, GS4I_NTH_CONST(s->w[1][j], n), p2);
        for (k = 0; k < 3; k++) {
            gs4_real *row = tile + GS4I_TILE * (GS4I_TILE * k + j);
            GS4I_LOAD(r, row);
            GS4I_SPLAT_MUL(t, GS4I_NTH_CONST(s->w[2][k], n), a);
            GS4I_SPLAT_MAD(t, GS4I_NTH_CONST(s->d[2][k], n), b);
            GS4I_SUM(r, r, t);
            GS4I_STORE(row, r);
        }
    }
}

/* Stress of the stage, in grad v_i, to faces: f_c = - sum over particles of V sigma_ca dw/dx_a.
 * Heat to nodes, which are the centres of cells. */
static void gs4i_scatter_stress(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    gs4i_staggered *f = &sim->staggered;
    const gs4i_particles p = sim->particles;
    gs4i_heat_pass heat_pass, *heat = p.with_heat ? &heat_pass : NULL;
    const int o = pass->blocks[index];
    const gs4i_frame frame = gs4i_tile_frame(&sim->grid, sim->grid.occupied_block[o]);
    size_t i = (size_t)sim->grid.first[o], end = (size_t)sim->grid.first[o + 1];
    gs4i_number_tile velocity[3], force[3];
    gs4i_response r;
    int c, a;
    gs4i_begin_response(&r, sim, &p, &sim->integrator, &sim->reports[o], heat);
    for (c = 0; c < 3; c++) gs4i_load_velocity_tile(sim, o, c, velocity[c]);
    memset(force, 0, sizeof force);
    if (heat) gs4i_clear_heat_tiles(heat);
    for (; i < end; i += GS4I_BATCH) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s[4];
        gs4i_gathered slope;
        gs4i_gradient L, push;
        gs4i_symmetric sigma;
        gs4i_lanes J, mu;
        int b;
        gs4i_stage_faces(sim, &frame, i, n, &q, s);
        gs4i_gather_slopes(velocity, s, n, &slope);
        gs4i_gradient_lanes(slope.dx, slope.dy, slope.dz, n, L);
        GS4I_BATCH_LOOP(b) J[b] = q.v[3][b] + sim->integrator.before * q.a[3][b];
        gs4i_turn_to_batch(&r, i, n);
        if (heat) gs4i_load_batch_heat(&r);
        gs4i_stress(&r, L, J, sigma, mu);
        gs4i_check_liquids(r.report, J, mu, p.id + i, n);
        if (heat) {
            gs4i_heat_of_stress(&r, q.x[3], J, L, sigma);
            gs4i_scatter_heat(sim, heat, &s[0], n);
        }
        for (c = 0; c < 3; c++)
            for (a = 0; a < 3; a++)
                GS4I_BATCH_LOOP(b)
                    push[c][a][b] =
                        -q.x[3][b] * r.constants.inv_density[b] * J[b] * sigma[gs4i_place[c][a]][b];
        for (b = 0; b < n; b++)
            for (c = 0; c < 3; c++) gs4i_scatter_slope(force[c], &s[1 + c], b, push[c]);
    }
    for (c = 0; c < 3; c++)
        if (f->is_viscous) gs4i_add_face_tile(sim, o, 1 << c, 1, force[c], f->force[c]);
    gs4i_report_liquids(r.report, &r.seen);
    if (heat) gs4i_add_heat(sim, o, heat);
}

/* C as the faces see it now: where velocities were set by hand. */
static void gs4i_find_affine_task(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    const gs4i_particles p = sim->particles;
    const int o = pass->blocks[index];
    const gs4i_frame frame = gs4i_tile_frame(&sim->grid, sim->grid.occupied_block[o]);
    size_t i = (size_t)sim->grid.first[o], end = (size_t)sim->grid.first[o + 1];
    gs4i_number_tile velocity[3];
    int b, c;
    for (c = 0; c < 3; c++) gs4i_load_velocity_tile(sim, o, c, velocity[c]);
    for (; i < end; i += GS4I_BATCH) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s[4];
        gs4i_gathered slope;
        gs4i_stage_faces(sim, &frame, i, n, &q, s);
        gs4i_gather_slopes(velocity, s, n, &slope);
        for (b = 0; b < n; b++) slope.dx[4 * b + 3] = p.affine[0][4 * (i + (size_t)b) + 3];
        gs4i_store_affine(&p, i, n, &slope, 1);
    }
}

/* --- what faces take from the solves ---------------------------------------------------------- */

/* acc_raw = (u~ - v**)/s in place of acc, and once more as feedback. */
static void gs4i_raw_acceleration(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    const gs4_real inv_s = 1 / pass->sim->integrator.s;
    int c, at[3];
    size_t i;
    for (c = 0; c < 3; c++)
        GS4I_EACH_FACE(f, c, z, at, i) {
            gs4_real *t = f->taken[c] + 4 * i;
            const gs4_real raw =
                (t[GS4I_FACE_STAGE] - f->given[c][4 * i + GS4I_FACE_VELOCITY]) * inv_s;
            if (f->known[c][i] == GS4I_FACE_SOLVED)
                t[GS4I_FACE_ACCELERATION] = t[GS4I_FACE_FEEDBACK] = raw;
            if (f->known[c][i] == GS4I_FACE_AT_WALL) t[GS4I_FACE_FEEDBACK] = raw;
        }
}

/* The feedback theta (acc_raw - acc) in place of acc_raw. What was extrapolated for the split is
 * forgotten. */
static void gs4i_split_acceleration(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    int c, at[3];
    size_t i;
    for (c = 0; c < 3; c++)
        GS4I_EACH_FACE(f, c, z, at, i) {
            gs4_real *t = f->taken[c] + 4 * i;
            t[GS4I_FACE_FEEDBACK] =
                f->known[c][i] == GS4I_FACE_SOLVED || f->known[c][i] == GS4I_FACE_AT_WALL
                    ? pass->scale * (t[GS4I_FACE_FEEDBACK] - t[GS4I_FACE_ACCELERATION])
                    : GS4I_C(0);
            if (f->known[c][i] >= GS4I_FACE_LAYER) f->known[c][i] = GS4I_FACE_UNKNOWN;
        }
}

/* What particles take: acc with its feedback, and v_i in place of that; ag + (acc - ag)/alpha_m in
 * place of ag. */
static void gs4i_finish_taken(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    int c, at[3];
    size_t i;
    for (c = 0; c < 3; c++)
        GS4I_EACH_FACE(f, c, z, at, i) {
            gs4_real *t = f->taken[c] + 4 * i, *ag = f->given[c] + 4 * i + GS4I_FACE_RATE;
            *ag += (t[GS4I_FACE_ACCELERATION] - *ag) * pass->sim->integrator.inv_alpha_m;
            t[GS4I_FACE_ACCELERATION] += t[GS4I_FACE_FEEDBACK];
            t[GS4I_FACE_SEEN] = f->seen[c][i];
        }
}

/* Correction of volume: how much too full a cell is, at most a half, times the rate; where air is
 * near, only what is too much. */
static void gs4i_excess_of_volume(int z, void *context)
{
    const gs4i_staggered_pass *pass = (const gs4i_staggered_pass *)context;
    gs4i_staggered *f = &pass->sim->staggered;
    const gs4i_box *box = &f->box;
    int at[3], x, y, k;
    size_t i;
    GS4I_BOX_PLANE(box, GS4I_AT_CELL, z, at, i) {
        gs4_real e;
        int air = 0;
        f->pressure[i] = f->rhs[i] = 0;
        if (f->kind[i] != GS4_CELL_LIQUID || gs4i_is_copy(f, at)) continue;
        for (k = -1; k <= 1; k++)
            for (y = -1; y <= 1; y++)
                for (x = -1; x <= 1; x++)
                    air |=
                        f->kind[gs4i_box_index(box, GS4I_AT_CELL, at[0] + x, at[1] + y, at[2] + k)]
                        == GS4_CELL_AIR;
        e = gs4i_max(GS4I_C(-0.5), gs4i_min(f->cell[4 * i + GS4I_CELL_FILL] - 1, GS4I_C(0.5)));
        /* a dead band, or noise at the surface would be rectified */
        f->rhs[i] = pass->scale * (air ? gs4i_max(e - GS4I_C(0.1), 0) : e);
    }
}

static int gs4i_correct_volume(gs4_sim *sim, gs4_real fastest)
{
    gs4i_staggered *f = &sim->staggered;
    gs4i_staggered_pass pass;
    const gs4_real dt = sim->integrator.dt;
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    pass.what = GS4I_FACE_CORRECTION;
    pass.scale = gs4i_min(fastest * sim->grid.inv_h, GS4I_C(GS4I_MOST_CORRECTION) / dt);
    gs4i_parallel_for(&sim->tasks, f->box.size[2], gs4i_excess_of_volume, &pass);
    return gs4i_solve_pressure(sim, &pass);
}

/* --- the parts of the step -------------------------------------------------------------------- */

static int gs4i_clear_faces(gs4_sim *sim, gs4i_node_pass *nodes)
{
    if (sim->particles.with_heat)
        gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_clear_nodes, nodes);
    return gs4i_begin_staggered(sim);
}

/* v_i on faces and volumes in cells, walls included. */
static void gs4i_fold_faces(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_staggered *f = &sim->staggered;
    gs4i_staggered_pass pass;
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    pass.lightest = nodes->lightest;
    gs4i_mirror_faces(sim, f->given, gs4i_fold_given);
    gs4i_each_mirror(sim, GS4I_AT_CELL, f->cell, gs4i_fold_given);
    gs4i_parallel_for(&sim->tasks, f->box.size[2] + 1, gs4i_face_velocities, &pass);
    gs4i_wrap_faces(sim, f->given, 4);
    gs4i_wrap_cells(sim, f->cell, 4);
}

static int gs4i_finish_faces(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_guess_contact(sim);
    gs4i_fold_faces(sim, nodes);
    return GS4_OK;
}

/* The same once more, where contact is not what it was. */
static void gs4i_scatter_again(gs4_sim *sim, gs4i_node_pass *nodes)
{
    if (sim->particles.with_heat)
        gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_clear_nodes, nodes);
    gs4i_parallel_for(&sim->tasks, sim->staggered.box.size[2] + 1, gs4i_clear_staggered,
                      &sim->staggered);
    gs4i_scatter(sim, gs4i_scatter_to_faces);
    gs4i_fold_faces(sim, nodes);
}

/* What scattering J to cells and gathering from cells smooth away of a field q: h^2/8 of its
 * Laplacian each. Next to air that is not known along that axis. Cells then see at most what was
 * solved for, sinc(k h/2)^6 (1 + sin(k h/2)^2) < 1 of it, so the implicit pressure stays stable. */
static gs4_real gs4i_smoothed_away(const gs4i_staggered *f, const gs4_real *q, const int at[3])
{
    const size_t i = gs4i_box_index(&f->box, GS4I_AT_CELL, at[0], at[1], at[2]);
    gs4_real sum = 0;
    int a, side;
    for (a = 0; a < 3; a++) {
        gs4_real here = 0;
        int air = 0;
        for (side = -1; side <= 1; side += 2) {
            int p[3];
            size_t n;
            memcpy(p, at, sizeof p);
            p[a] = gs4i_around(f, a, at[a] + side);
            n = gs4i_box_index(&f->box, GS4I_AT_CELL, p[0], p[1], p[2]);
            air |= f->kind[n] == GS4_CELL_AIR;
            if (f->kind[n] == GS4_CELL_LIQUID) here += q[i] - q[n];
        }
        if (!air) sum += here;
    }
    return GS4I_C(0.25) * sum;
}

/* div u~ of liquid cells, for J, where the right-hand side was, with what its way to J and back to
 * cells smooths away. The largest. */
static gs4_real gs4i_find_divergence(gs4_sim *sim)
{
    gs4i_staggered *f = &sim->staggered;
    gs4_real most = 0;
    int z, at[3];
    size_t i;
    for (z = 0; z < f->box.size[2]; z++)
        GS4I_BOX_PLANE(&f->box, GS4I_AT_CELL, z, at, i) {
            f->pressure[i] = f->rhs[i] = 0;
            if (f->kind[i] == GS4_CELL_LIQUID && !gs4i_is_copy(f, at))
                f->pressure[i] = gs4i_face_divergence(f, GS4I_FACE_STAGE, at, sim->grid.inv_h);
        }
    for (z = 0; z < f->box.size[2]; z++)
        GS4I_BOX_PLANE(&f->box, GS4I_AT_CELL, z, at, i) {
            if (f->kind[i] != GS4_CELL_LIQUID || gs4i_is_copy(f, at)) continue;
            f->rhs[i] = f->pressure[i] + gs4i_smoothed_away(f, f->pressure, at);
            most = gs4i_max(most, gs4i_abs(f->rhs[i]));
        }
    gs4i_each_mirror(sim, GS4I_AT_CELL, f->rhs, gs4i_fill_number);
    gs4i_wrap_cells(sim, f->rhs, 1);
    return most;
}

/* acc is what pressure leaves of the rate of u~; or, split, (P2). What is held by its impact alone
 * takes as much feedback as there may be, or its particles would press on for long. */
static int gs4i_finish_acceleration(gs4_sim *sim, gs4_real fastest)
{
    gs4i_staggered *f = &sim->staggered;
    gs4i_staggered_pass pass;
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    gs4i_parallel_for(&sim->tasks, f->box.size[2] + 1, gs4i_raw_acceleration, &pass);
    if (!f->is_plain && !f->without_split) {
        gs4i_extrapolate(sim, GS4I_FACE_STAGE + 1);
        gs4i_mirror_faces(sim, f->taken, gs4i_fill_first);
        GS4I_TRY(gs4i_project(sim, GS4I_FACE_ACCELERATION));
        pass.scale = gs4i_min(GS4I_C(0.5), sim->integrator.s * fastest * sim->grid.inv_h);
    }
    if (f->contact && (f->is_plain || gs4i_is_impact(sim))) pass.scale = sim->integrator.impact;
    gs4i_parallel_for(&sim->tasks, f->box.size[2] + 1, gs4i_split_acceleration, &pass);
    return GS4_OK;
}

/* --- stress at surfaces ----------------------------------------------------------------------- *
 *
 * Faces beyond liquid do as those that they are extrapolated from, u = E u_in. Forces f there, and
 * the mass m there, do so through these: with P = (1; E) acceleration by stress has the power of f
 * and the momentum of what particles take from it where
 *
 *     P^T M P a = P^T f                                                                       (P3)
 *
 * a is what comes nearest to f/m on all faces, weighed by m. P has rigid motions, so momentum and
 * angular momentum stay. Sums of columns of P^T M P in place of it are negative at corners. */

/* A face beyond liquid, by numbers of those that it is extrapolated from: 2 one - two of each side
 * if it is linear, else the mean of one; or, with no sides, one of those that the solve moves.
 * Number 0 is what nothing moves: walls and bodies. What it depends on has lower numbers. */
typedef struct gs4i_fitted_face {
    size_t face;
    uint32_t one[6], two[6];
    int axis, sides, linear;
} gs4i_fitted_face;

typedef struct gs4i_fit {
    const gs4i_fitted_face *face;
    double *mass, *value;
    size_t count;
} gs4i_fit;

/* Numbers are kept, for as long as they are needed, where the correction of volume will be. */
static uint32_t gs4i_fitted_number(const gs4i_staggered *f, int c, size_t face)
{
    uint32_t number;
    memcpy(&number, f->taken[c] + 4 * face + GS4I_FACE_CORRECTION, sizeof number);
    return number;
}

/* The next number, for a face. NULL when memory is refused. */
static gs4i_fitted_face *gs4i_number_face(gs4_sim *sim, int c, size_t face, uint32_t *count)
{
    gs4i_staggered *f = &sim->staggered;
    const size_t size = sizeof(gs4i_fitted_face), keep = *count * size;
    gs4i_fitted_face *list =
        (gs4i_fitted_face *)gs4i_scratch_reserve(&sim->memory, &f->fitted, keep + size, keep);
    if (!list) return NULL;
    list += *count;
    memset(list, 0, size);
    list->face = face;
    list->axis = c;
    memcpy(f->taken[c] + 4 * face + GS4I_FACE_CORRECTION, count, sizeof *count);
    (*count)++;
    return list;
}

/* The number of a face that others are extrapolated from. */
static int gs4i_number_source(gs4_sim *sim, int c, size_t face, uint32_t *count, uint32_t *number)
{
    gs4i_staggered *f = &sim->staggered;
    if (f->known[c][face] == GS4I_FACE_SOLVED && !gs4i_fitted_number(f, c, face)
        && !gs4i_number_face(sim, c, face, count))
        return GS4_ERROR_MEMORY;
    *number = gs4i_fitted_number(f, c, face);
    return GS4_OK;
}

/* The face some steps from another on a side; around a periodic axis, where that is a copy. */
static size_t gs4i_face_beside(const gs4i_staggered *f, int c, const int at[3], int side, int steps)
{
    const int a = side / 2;
    int p[3];
    memcpy(p, at, sizeof p);
    p[a] = gs4i_around(f, a, at[a] + (side & 1 ? steps : -steps));
    return gs4i_box_index(&f->box, 1 << c, p[0], p[1], p[2]);
}

/* One face beyond liquid, as gs4i_extrapolate_face has it. */
static int gs4i_number_beyond(gs4_sim *sim, int c, const int at[3], size_t i, uint32_t *count)
{
    const gs4i_staggered *f = &sim->staggered;
    const uint8_t *known = f->known[c];
    gs4i_fitted_face q, *to;
    int side;
    memset(&q, 0, sizeof q);
    for (side = 0; side < 6; side++) {
        const int a = side / 2, last = f->to[a] - (a != c);
        const int room = f->box.periodic[a] ? 2 : side & 1 ? last - at[a] : at[a] - f->from[a];
        size_t n1, n2 = 0;
        int linear;
        if (room < 1) continue;
        n1 = gs4i_face_beside(f, c, at, side, 1);
        if (!known[n1] || known[n1] >= known[i]) continue;
        if (room >= 2) n2 = gs4i_face_beside(f, c, at, side, 2);
        linear = room >= 2 && known[n2] && known[n2] < known[i];
        if (q.linear && !linear) continue;
        if (linear && !q.linear) q.sides = 0;
        q.linear |= linear;
        GS4I_TRY(gs4i_number_source(sim, c, n1, count, &q.one[q.sides]));
        q.two[q.sides] = 0;
        if (linear) GS4I_TRY(gs4i_number_source(sim, c, n2, count, &q.two[q.sides]));
        q.sides++;
    }
    if (!(to = gs4i_number_face(sim, c, i, count))) return GS4_ERROR_MEMORY;
    q.face = i;
    q.axis = c;
    *to = q;
    return GS4_OK;
}

/* All faces beyond liquid, layer by layer, and those that they depend on; and vectors for them. */
static int gs4i_begin_fit(gs4_sim *sim, gs4i_fit *fit, gs4i_krylov *k)
{
    gs4i_staggered *f = &sim->staggered;
    int layer, c, z, at[3];
    uint32_t count = 1;
    size_t i;
    if (!gs4i_scratch_reserve(&sim->memory, &f->fitted, sizeof *fit->face, 0))
        return GS4_ERROR_MEMORY;
    gs4i_extrapolate(sim, 0);
    for (layer = GS4I_FACE_LAYER; layer < GS4I_FACE_LAYER + GS4I_FACE_LAYERS; layer++)
        for (c = 0; c < 3; c++)
            for (z = 0; z <= f->box.size[2]; z++)
                GS4I_EACH_FACE(f, c, z, at, i)
                    if (f->known[c][i] == layer && !gs4i_is_copy(f, at))
                        GS4I_TRY(gs4i_number_beyond(sim, c, at, i, &count));
    fit->count = count;
    fit->face = (const gs4i_fitted_face *)f->fitted.data;
    k->n = count;
    k->x = (double *)gs4i_scratch_reserve(&sim->memory, &f->fit, 6 * count * sizeof *k->x, 0);
    if (!k->x) return GS4_ERROR_MEMORY;
    k->r = k->x + count;
    k->p = k->r + count;
    k->q = k->p + count;
    fit->mass = k->q + count;
    fit->value = fit->mass + count;
    fit->mass[0] = k->r[0] = 0;
    for (i = 1; i < count; i++) {
        const gs4i_fitted_face *q = fit->face + i;
        fit->mass[i] = (double)f->given[q->axis][4 * q->face + GS4I_FACE_MASS];
        k->r[i] = (double)f->force[q->axis][q->face];
    }
    return GS4_OK;
}

/* value = P value, from what the solve moves. */
static void gs4i_fit_extrapolate(const gs4i_fit *fit)
{
    double *v = fit->value;
    size_t i;
    int n;
    v[0] = 0;
    for (i = 1; i < fit->count; i++) {
        const gs4i_fitted_face *q = fit->face + i;
        double sum = 0;
        if (!q->sides) continue;
        for (n = 0; n < q->sides; n++)
            sum += q->linear ? 2 * v[q->one[n]] - v[q->two[n]] : v[q->one[n]];
        v[i] = sum / q->sides;
    }
}

/* v = P^T v: to what the solve moves; nothing stays elsewhere. */
static void gs4i_fit_fold(const gs4i_fit *fit, double *v)
{
    size_t i;
    int n;
    for (i = fit->count - 1; i; i--) {
        const gs4i_fitted_face *q = fit->face + i;
        for (n = 0; n < q->sides; n++) {
            const double part = v[i] / q->sides;
            v[q->one[n]] += q->linear ? 2 * part : part;
            if (q->linear) v[q->two[n]] -= part;
        }
        if (q->sides) v[i] = 0;
    }
    v[0] = 0;
}

static void gs4i_fit_apply(void *context, const double *p, double *out)
{
    const gs4i_fit *fit = (const gs4i_fit *)context;
    size_t i;
    memcpy(fit->value, p, fit->count * sizeof *p);
    gs4i_fit_extrapolate(fit);
    for (i = 0; i < fit->count; i++) out[i] = fit->mass[i] * fit->value[i];
    gs4i_fit_fold(fit, out);
}

static int gs4i_fit_precondition(void *context, const double *r, double *out)
{
    const gs4i_fit *fit = (const gs4i_fit *)context;
    size_t i;
    for (i = 0; i < fit->count; i++) out[i] = i && !fit->face[i].sides ? r[i] / fit->mass[i] : 0;
    return GS4_OK;
}

/* Of the folded forces, so much may be left over: momentum is conserved within it. About 12
 * iterations. */
#define GS4I_FIT_TOLERANCE (sizeof(gs4_real) == 8 ? 1e-12 : 1e-8)
#define GS4I_FIT_ITERATIONS 200

/* (P3), into the first guess of u~. */
static int gs4i_fit_stress(gs4_sim *sim)
{
    gs4i_staggered *f = &sim->staggered;
    gs4i_fit fit;
    gs4i_krylov k;
    int result = gs4i_begin_fit(sim, &fit, &k);
    size_t i;
    if (result != GS4_OK) return gs4i_fail_memory(&sim->error);
    k.apply = gs4i_fit_apply;
    k.precondition = gs4i_fit_precondition;
    k.context = &fit;
    gs4i_fit_fold(&fit, k.r);
    result = gs4i_conjugate_gradients(&k, GS4I_FIT_TOLERANCE, GS4I_FIT_ITERATIONS);
    if (result != GS4_OK)
        return gs4i_fail_value(&sim->error, GS4_ERROR_UNSTABLE,
                               "of the forces of stress at surfaces a part of ", k.residual,
                               " could not be balanced, as they are not finite or absurd; the "
                               "step was not taken; a smaller dt would do");
    for (i = 1; i < fit.count; i++) {
        const gs4i_fitted_face *q = fit.face + i;
        gs4_real *t = f->taken[q->axis] + 4 * q->face;
        t[GS4I_FACE_CORRECTION] = 0;
        if (q->sides) {
            f->known[q->axis][q->face] = GS4I_FACE_UNKNOWN;
            continue;
        }
        t[GS4I_FACE_ACCELERATION] = GS4I_C(k.x[i]) + gs4i_axis_of(sim->desc.gravity, q->axis);
        t[GS4I_FACE_STAGE] = f->given[q->axis][4 * q->face + GS4I_FACE_VELOCITY]
                             + sim->integrator.s * t[GS4I_FACE_ACCELERATION];
    }
    gs4i_wrap_faces(sim, f->taken, 4);
    gs4i_wrap_bytes(sim, f->known);
    return GS4_OK;
}

/* S4, S5 and u~. */
static int gs4i_find_stage_velocity(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_staggered *f = &sim->staggered;
    const int planes = f->box.size[2], with_heat = sim->particles.with_heat;
    gs4i_staggered_pass pass;
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    pass.lightest = nodes->lightest;
    gs4i_place_bodies(sim, nodes);
    if (f->is_viscous || with_heat) {
        gs4i_mirror_faces(sim, f->given, gs4i_fill_given);
        gs4i_scatter(sim, gs4i_scatter_stress);
        if (f->is_viscous) gs4i_mirror_faces(sim, f->force, gs4i_fold_number);
    }
    gs4i_parallel_for(&sim->tasks, planes + 1, gs4i_predict_faces, &pass);
    gs4i_wrap_faces(sim, f->given, 4);
    gs4i_wrap_faces(sim, f->taken, 4);
    gs4i_wrap_faces(sim, f->seen, 1);
    gs4i_parallel_for(&sim->tasks, planes, gs4i_classify_cells, &pass);
    gs4i_parallel_for(&sim->tasks, planes + 1, gs4i_classify_faces, &pass);
    if (f->is_viscous) GS4I_TRY(gs4i_fit_stress(sim));
    GS4I_TRY(gs4i_setup_pressure(sim));
    return gs4i_project(sim, GS4I_FACE_STAGE);
}

/* How often contact is revised in a step. */
#define GS4I_REVISIONS 3

/* S4 to S6. */
static int gs4i_accelerate_by_projection(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_staggered *f = &sim->staggered;
    const int planes = f->box.size[2];
    const double start = gs4i_now(sim);
    gs4i_staggered_pass pass;
    gs4_real fastest, most = 0;
    int n;
    memset(&pass, 0, sizeof pass);
    pass.sim = sim;
    GS4I_TRY(gs4i_find_stage_velocity(sim, nodes));
    for (n = 1; f->contact && n <= GS4I_REVISIONS && gs4i_revise_contact(sim, n == GS4I_REVISIONS);
         n++) {
        gs4i_scatter_again(sim, nodes);
        GS4I_TRY(gs4i_find_stage_velocity(sim, nodes));
    }
    if (f->contact) GS4I_TRY(gs4i_check_inflow(sim));
    gs4i_take_pressure(sim);
    fastest = gs4i_fastest_face(f);
    GS4I_TRY(gs4i_finish_acceleration(sim, fastest));
    if (!f->without_correction) GS4I_TRY(gs4i_correct_volume(sim, fastest));
    if (f->compressible) most = gs4i_find_divergence(sim);
    gs4i_extrapolate(sim, 4);
    gs4i_parallel_for(&sim->tasks, planes + 1, gs4i_finish_taken, &pass);
    gs4i_mirror_faces(sim, f->taken, gs4i_fill_taken);
    f->is_safe = !sim->particles.elastic_reals && !sim->particles.deformation_reals
                 && fastest * sim->integrator.dt < sim->grid.h
                 && most * sim->integrator.dt < GS4I_C(GS4I_SAFE_STRAIN);
    sim->seconds[GS4I_CLOCK_SOLVE] += gs4i_since(sim, start);
    return GS4_OK;
}

/* --- S7 --------------------------------------------------------------------------------------- */

/* What faces say to a batch. Particles without liquid around fly by themselves. */
typedef struct gs4i_face_corrections {
    gs4i_lanes U[3], A[3], shift[3]; /* sum w u~; sum w (acc + feedback); u_c */
    gs4i_lanes subgrid[4];           /* V - v~; how much faster it decays as noise */
    gs4i_gradient L;                 /* of u~ */
    gs4i_lanes div;
} gs4i_face_corrections;

/* What a block takes: quads of the faces, and of cells; and a bit for each cell of the tile that
 * has liquid around, 8 of a row a byte. */
typedef struct gs4i_taken_tiles {
    gs4i_face_tile face[3], cells;
    uint8_t near_liquid[GS4I_TILE * GS4I_TILE];
} gs4i_taken_tiles;

static void gs4i_load_taken(const gs4_sim *sim, int o, gs4i_taken_tiles *t)
{
    const gs4i_staggered *f = &sim->staggered;
    uint8_t liquid[GS4I_TILE * GS4I_TILE] = { 0 };
    int first[3], row, i;
    gs4i_block_origin(&sim->grid, sim->grid.occupied_block[o], first);
    gs4i_load_face_tile(sim, o, GS4I_AT_CELL, f->cell, t->cells);
    for (row = 0; row < 64; row++) {
        const size_t at = gs4i_face_row(f, first, GS4I_AT_CELL, row);
        for (i = 0; i < GS4I_TILE; i++)
            liquid[row] |= (uint8_t)((f->kind[at + (size_t)i] == GS4_CELL_LIQUID) << i);
        for (i = 0; i < GS4I_TILE && f->compressible; i++)
            t->cells[4 * (GS4I_TILE * row + i) + GS4I_CELL_DIVERGENCE] = f->rhs[at + (size_t)i];
    }
    memset(t->near_liquid, 0, sizeof t->near_liquid);
    for (row = 9; row < 55; row++) {
        unsigned any = 0;
        for (i = 0; i < 9; i++) any |= liquid[row + GS4I_TILE * (i / 3 - 1) + i % 3 - 1];
        t->near_liquid[row] = (uint8_t)(any | any << 1 | any >> 1);
    }
    for (i = 0; i < 3; i++) gs4i_load_face_tile(sim, o, 1 << i, f->taken[i], t->face[i]);
}

/* Is there liquid among the 27 cells that particle b sees? */
GS4I_INLINE int gs4i_is_near_liquid(const gs4i_taken_tiles *t, const gs4i_stencils *cells, int b)
{
    const int middle = cells->base[b] + GS4I_TILE * (GS4I_TILE + 1) + 1;
    return t->near_liquid[middle / GS4I_TILE] >> middle % GS4I_TILE & 1;
}

/* Component c for all: u~, acc and feedback, v_i, u_c, and the slopes of u~. */
static void gs4i_gather_component(const gs4_sim *sim, int c, const gs4i_taken_tiles *t,
                                  const gs4i_batch *q, int n, const gs4i_stencils s[4],
                                  gs4i_gathered *g)
{
    const gs4i_integrator *r = &sim->integrator;
    const gs4_real gravity = gs4i_axis_of(sim->desc.gravity, c);
    int b;
    for (b = 0; b < n; b++) {
        gs4i_row x, d;
        const gs4_real v = GS4I_NTH_CONST(q->v[c], b), a = GS4I_NTH_CONST(q->a[c], b);
        const gs4_real alone[4] = { v + r->before * a + r->s * gravity, gravity,
                                    v + r->prediction.ahead * a, 0 };
        if (gs4i_is_near_liquid(t, &s[0], b)) {
            gs4i_x_weights(&s[1 + c], b, &x, &d);
            gs4i_gather_local(t->face[c] + 4 * s[1 + c].base[b], &s[1 + c], b, &x, &d, g);
        } else {
            memcpy(g->value + 4 * b, alone, sizeof alone);
            g->dx[4 * b] = g->dy[4 * b] = g->dz[4 * b] = 0;
        }
    }
}

/* What particles take of cells: div u~ where liquids are compressed, and pressure, in number 3 of
 * dx. */
static void gs4i_gather_from_cells(const gs4_sim *sim, const gs4i_taken_tiles *t, int n,
                                   const gs4i_stencils *cells, gs4i_gathered *slope, gs4i_lanes div)
{
    gs4_real value[4 * GS4I_BATCH];
    int b;
    memset(div, 0, sizeof(gs4i_lanes));
    for (b = 0; b < n; b++) {
        gs4i_row x, d;
        if (!gs4i_is_near_liquid(t, cells, b)) continue;
        gs4i_x_weights(cells, b, &x, &d);
        gs4i_gather_value(t->cells + 4 * cells->base[b], cells, b, &x, value);
        slope->dx[4 * b + 3] = value[4 * b + GS4I_CELL_PRESSURE];
        if (sim->staggered.compressible) GS4I_NTH(div, b) = value[4 * b + GS4I_CELL_DIVERGENCE];
    }
}

static void gs4i_gather_from_faces(const gs4_sim *sim, const gs4i_taken_tiles *t,
                                   const gs4i_batch *q, int n, const gs4i_stencils s[4],
                                   gs4i_gathered *slope, gs4i_face_corrections *k)
{
    const gs4_real most = GS4I_C(0.1) * sim->grid.h / sim->integrator.dt;
    int b, c;
    memset(slope, 0, sizeof *slope);
    gs4i_gather_from_cells(sim, t, n, &s[0], slope, k->div);
    for (c = 0; c < 3; c++) {
        gs4i_gathered g;
        gs4i_lanes sum[4];
        gs4i_gather_component(sim, c, t, q, n, s, &g);
        gs4i_to_lanes(g.value, n, sum);
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide high = 0 * q->x[3][b] + most; /* at most h/10 */
            gs4i_wide shift;
            k->U[c][b] = sum[GS4I_FACE_STAGE][b];
            k->A[c][b] = sum[GS4I_FACE_ACCELERATION][b];
            k->subgrid[c][b] = sum[GS4I_FACE_SEEN][b];
            GS4I_WIDE_MIN(shift, sum[GS4I_FACE_CORRECTION][b], high);
            GS4I_WIDE_MAX(k->shift[c][b], shift, -high);
        }
        for (b = 0; b < n; b++) {
            slope->dx[4 * b + c] = g.dx[4 * b];
            slope->dy[4 * b + c] = g.dy[4 * b];
            slope->dz[4 * b + c] = g.dz[4 * b];
        }
    }
    gs4i_subgrid_of(&sim->integrator, q, 0, k->subgrid);
    gs4i_gradient_lanes(slope->dx, slope->dy, slope->dz, n, k->L);
}

/* Velocity by rule (4), with decay of what the grid does not see, implicit in itself; position with
 * the grid's velocity, and where volume wants it; J by the divergence. */
static void gs4i_correct_by_faces(gs4i_integrator r, const gs4i_face_corrections *k, gs4i_batch *q)
{
    int b, c;
    for (c = 0; c < 3; c++)
        GS4I_BATCH_LOOP(b) {
            const gs4i_wide v = q->v[c][b], a = q->a[c][b], move = q->move[c][b];
            const gs4i_wide stage_a =
                k->A[c][b] + (r.stable_decay + k->subgrid[3][b]) * k->subgrid[c][b];
            const gs4i_wide da = (stage_a - a) * r.inv_alpha_m,
                            change = (k->U[c][b] - move) * r.inv_alpha_m;
            q->v[c][b] = (v + r.dt * a) + r.gamma * r.dt * da;
            q->a[c][b] = a + da;
            if (r.decayed_at_once > 0) q->v[c][b] += r.decayed_at_once * k->subgrid[c][b];
            q->x[c][b] =
                ((q->x[c][b] + r.dt * move) + r.gamma * r.dt * change) + r.dt * k->shift[c][b];
            q->move[c][b] = (q->v[c][b] - (move + change)) - r.next_shift * q->a[c][b];
        }
    GS4I_BATCH_LOOP(b) {
        const gs4i_wide J = q->v[3][b], Jr = q->a[3][b];
        const gs4i_wide dJ = ((J + r.prediction.ahead * Jr) * k->div[b] - Jr)
                             / (r.alpha_m - r.alpha_f * r.gamma * r.dt * k->div[b]);
        q->v[3][b] = (J + r.dt * Jr) + r.gamma * r.dt * dJ;
        q->a[3][b] = Jr + dJ;
    }
}

static void gs4i_correct_from_faces(int index, void *context)
{
    const gs4i_pass *pass = (const gs4i_pass *)context;
    gs4_sim *sim = pass->sim;
    const gs4i_grid *g = &sim->grid;
    const gs4i_particles p = sim->particles;
    gs4i_heat_pass heat_pass, *heat = p.with_heat ? &heat_pass : NULL;
    const gs4i_integrator integrator = sim->integrator;
    const int o = pass->blocks[index];
    gs4i_report *report = &sim->reports[o];
    const gs4i_frame frame = gs4i_tile_frame(g, g->occupied_block[o]);
    gs4i_taken_tiles tiles;
    gs4i_response r;
    size_t i = (size_t)g->first[o], end = (size_t)g->first[o + 1];
    if (!pass->commit && sim->staggered.is_safe) return;
    gs4i_load_taken(sim, o, &tiles);
    gs4i_begin_response(&r, sim, &p, &integrator, report, heat);
    if (heat) gs4i_load_heat_tiles(sim, o, heat);
    for (; i < end; i += GS4I_BATCH) {
        const int n = gs4i_batch_size(i, end);
        gs4i_batch q;
        gs4i_stencils s[4];
        gs4i_gathered slope;
        gs4i_face_corrections k;
        gs4i_stored out;
        gs4i_stage_faces(sim, &frame, i, n, &q, s);
        gs4i_gather_from_faces(sim, &tiles, &q, n, s, &slope, &k);
        gs4i_correct_by_faces(integrator, &k, &q);
        gs4i_advance_response(&r, i, n, k.L, NULL, q.v[3], pass->commit);
        if (!pass->commit) {
            gs4i_validate_batch(&q, k.L, p.position + 4 * i, n, g->h, p.id + i, report);
            continue;
        }
        if (heat) gs4i_gather_heat(&r, &s[0], k.L, heat);
        gs4i_pack_batch(&q, 1, &out);
        gs4i_correct_contact(sim, o, NULL, i, n, &out, &slope, report);
        gs4i_see_motion(&r.seen, q.v, k.L);
        gs4i_store_batch(&p, i, n, &out);
        gs4i_store_affine(&p, i, n, &slope, integrator.restart);
    }
    if (pass->commit) gs4i_report_motion(report, &r.seen);
}

/* Does material press on a wall that separates, before a node behind it? */
static int gs4i_presses(const gs4_sim *sim, const int at[3])
{
    const gs4i_staggered *f = &sim->staggered;
    int side, any = 0;
    for (side = 0; side < 6 && f->contact; side++) {
        const int a = side / 2, there = side & 1 ? f->to[a] : f->from[a] - 1;
        if (at[a] != there || sim->desc.walls[side] != GS4_WALL_SEPARATE) continue;
        any |= f->contact[gs4i_wall_cell(sim, side, at, 0)] >> side & 1;
    }
    return any;
}

/* ag of the faces before a node, where they know theirs. */
static void gs4i_remember_faces(int index, void *context)
{
    const gs4i_node_pass *pass = (const gs4i_node_pass *)context;
    const gs4i_grid *g = &pass->sim->grid;
    const gs4i_staggered *f = &pass->sim->staggered;
    int s, i, c;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        int first[3], at[3];
        gs4i_block_origin(g, g->block[s], first);
        for (i = 0; i < GS4I_BLOCK_NODES; i++) {
            const uint32_t node = gs4i_first_node(s) + (uint32_t)i;
            gs4_real *ag = gs4i_of_node(g->remembered, node);
            int known = 0;
            gs4i_node_coordinates(first, i, at);
            for (c = 0; c < 3; c++) at[c] -= f->box.low[c];
            for (c = 0; c < 3; c++) {
                const size_t face = gs4i_box_index(&f->box, 1 << c, at[0], at[1], at[2]);
                ag[c] = 0;
                if (f->known[c][face] == GS4I_FACE_UNKNOWN || gs4i_is_copy(f, at)) continue;
                ag[c] = f->given[c][4 * face + GS4I_FACE_RATE];
                known |= 1 << c;
            }
            ag[3] = 0;
            g->flags[node] = (uint8_t)(known | (known ? GS4I_REMEMBERS : 0)
                                       | (gs4i_presses(pass->sim, at) ? GS4I_WAS_PRESSED : 0));
        }
    }
}

/* Viscosity and elasticity stay explicit: nu dt/h^2 at most 0.4, of backward Euler 0.2; waves of
 * elasticity half a cell a step. So do places of surfaces: ripples of a few cells, whose frequency
 * is about sqrt(g/h), grow from dt sqrt(g/h) .8 on with backward Euler, .7 with rho (1, 0) and .5
 * with (1, .9); see test_partitioned_ripples. */
static double gs4i_stable_partitioned_dt(const gs4_sim *sim, double c, double nu)
{
    const double h = (double)sim->grid.h,
                 most = sim->desc.integrator == GS4_INTEGRATOR_GS4 ? 0.4 : 0.2;
    const gs4_vec3 g = sim->desc.gravity;
    const double fall = (double)gs4i_max(gs4i_abs(g.x), gs4i_max(gs4i_abs(g.y), gs4i_abs(g.z)));
    double dt = (double)GS4I_HUGE;
    if (nu > 0) dt = fmin(dt, most * h * h / nu);
    if (c > 0) dt = fmin(dt, 0.5 * h / c);
    if (fall > 0) dt = fmin(dt, (0.5 - 0.25 * (double)sim->desc.rho_inf_spurious) * sqrt(h / fall));
    return dt;
}

/* The scheme of a simulation. Nothing else asks which it is. */
static const gs4i_scheme *gs4i_scheme_of(const gs4_sim *sim)
{
    static const gs4i_scheme gs4 = { gs4i_scatter_momentum,       gs4i_correct,
                                     gs4i_remember_accelerations, gs4i_clear_all_nodes,
                                     gs4i_set_velocities,         gs4i_accelerate_explicitly,
                                     gs4i_stable_explicit_dt };
    static const gs4i_scheme euler = {
        gs4i_scatter_affinely, gs4i_gather_euler,   NULL,
        gs4i_clear_all_nodes,  gs4i_set_velocities, gs4i_accelerate_nothing,
        gs4i_stable_euler_dt
    };
    static const gs4i_scheme partitioned = {
        gs4i_scatter_to_faces,     gs4i_correct_from_faces, gs4i_remember_faces,
        gs4i_clear_faces,          gs4i_finish_faces,       gs4i_accelerate_by_projection,
        gs4i_stable_partitioned_dt
    };
    if (sim->desc.scheme == GS4_PARTITIONED) return &partitioned;
    return sim->desc.integrator == GS4_INTEGRATOR_SYMPLECTIC_EULER ? &euler : &gs4;
}

/* ==== [[conduction]] heat from node to node ==================================================== *
 *
 * Unknown is the temperature change x = T~ - T** of every node with material, so that what the
 * solver leaves undone is small against the heat that moves. Nodes are cells of [[box]], the
 * equation is that of [[elliptic]], with d the heat capacity of a volume and
 *
 *     c_f = s K_f fill_f,   K_f the harmonic mean of both conductivities k_eff,
 *                           fill_f the mean of both fill fractions,
 *     b   = s power + (1/h^2) sum_faces c_f (T**_j - T**_i).
 *
 * At a free surface c_f fades with the material: it is insulated. Isothermal surfaces are links
 * of a node to a given temperature, l = s k_eff area/distance in d and l (T_given - T**) in b:
 * of a wall at h/2 from the nodes beside it; of air and bodies see gs4i_isothermal_links. */

/* How (m c, m c T**, V/k_eff, V) and sources (W, W/K) fold at the walls: evenly where a wall is
 * insulated, T oddly about its temperature where it is not. */
static void gs4i_fold_heat(const gs4_sim *sim)
{
    const gs4i_conduction *k = &sim->conduction;
    gs4i_parity nodes[6], sources[6];
    int wall, c;
    memset(nodes, 0, sizeof nodes);
    for (wall = 0; wall < 6; wall++) {
        const int odd = sim->desc.wall_is_isothermal[wall];
        for (c = 0; c < 4; c++) nodes[wall].sign[c] = 1;
        nodes[wall].reals = 4;
        nodes[wall].always = 1;
        sources[wall] = nodes[wall];
        sources[wall].reals = 2;
        if (!odd) continue;
        sources[wall].sign[0] = nodes[wall].sign[1] = -1;
        nodes[wall].shift[1] = 2 * sim->desc.wall_temperature[wall]; /* by m c */
    }
    gs4i_fold(&sim->boundary, &sim->grid, k->heat_nodes, nodes);
    if (k->heat_sources) gs4i_fold(&sim->boundary, &sim->grid, k->heat_sources, sources);
}

/* How mirror nodes continue what particles gather: (T~ - T**, rate of mixing, rate times the
 * temperature to mix to, rate of mixing behind isothermal walls) and (components of T~,
 * resistance); oddly about its temperature where a wall is isothermal. */
static void gs4i_fill_heat(const gs4_sim *sim)
{
    const gs4i_conduction *k = &sim->conduction;
    gs4i_parity nodes[6], flux[6];
    int wall, c;
    memset(nodes, 0, sizeof nodes);
    for (wall = 0; wall < 6; wall++) {
        const int odd = sim->desc.wall_is_isothermal[wall];
        const gs4_real twice = odd ? 2 * sim->desc.wall_temperature[wall] : 0;
        for (c = 0; c < 4; c++) nodes[wall].sign[c] = GS4I_C(!odd || c == 1 ? 1 : c == 3 ? 0 : -1);
        nodes[wall].reals = 4;
        nodes[wall].always = 1;
        flux[wall] = nodes[wall];
        nodes[wall].shift[2] = twice;
        nodes[wall].shift[3] = GS4I_C(odd);
        nodes[wall].by = 1;
        flux[wall].by = -1;
        flux[wall].sign[1] = flux[wall].sign[0];
        flux[wall].sign[3] = 1;
        for (c = 0; c < 3; c++) flux[wall].shift[c] = twice;
    }
    gs4i_fill(&sim->boundary, &sim->grid, k->heat_nodes, nodes);
    if (sim->particles.with_flux) gs4i_fill(&sim->boundary, &sim->grid, k->heat_sources, flux);
}

/* --- to the box ------------------------------------------------------------------------------- */

/* The box, its fields, and which boundaries have a temperature. */
static int gs4i_begin_conduction(gs4_sim *sim)
{
    gs4i_conduction *k = &sim->conduction;
    gs4i_elliptic *e = &k->system;
    gs4i_box *box = &k->box;
    gs4_real **const fields[5] = { &k->temperature, &k->conductivity, &k->fill_fraction,
                                   &k->capacity, &k->mixing };
    size_t cells;
    int a;
    gs4i_box_fit(box, &sim->grid, sim->desc.walls, 0);
    if (gs4i_box_reserve(&sim->memory, box, gs4i_elliptic_bytes(box) + 5 * sizeof(gs4_real))
        != GS4_OK)
        return GS4_ERROR_MEMORY;
    cells = gs4i_box_count(box, GS4I_AT_CELL);
    for (a = 0; a < 5; a++) {
        *fields[a] = (gs4_real *)gs4i_box_take(box, sizeof(gs4_real));
        memset(*fields[a], 0, cells * sizeof(gs4_real));
    }
    gs4i_elliptic_take(e, box);
    memset(e->kind, GS4_CELL_SOLID, cells);
    memset(e->diagonal, 0, cells * sizeof *e->diagonal);
    memset(e->rhs, 0, cells * sizeof *e->rhs);
    memset(e->x, 0, cells * sizeof *e->x);
    e->tasks = e->solver.tasks = &sim->tasks;
    e->solver.memory = &sim->memory;
    e->h = sim->grid.h;
    e->inv_h = sim->grid.inv_h;
    e->tolerance = (double)sim->desc.solver_tolerance;
    e->max_iterations = sim->desc.solver_max_iterations;
    k->surface_is_isothermal = sim->desc.air_is_isothermal;
    for (a = 0; a < sim->boundary.collider_count; a++)
        k->surface_is_isothermal |= sim->boundary.colliders[a].is.is_isothermal;
    k->boundary_is_isothermal = k->surface_is_isothermal;
    for (a = 0; a < 6; a++) k->boundary_is_isothermal |= sim->desc.wall_is_isothermal[a];
    return GS4_OK;
}

/* Mixing of a node (W/(m^3 K)), at most as fast as the integrator takes. */
GS4I_INLINE gs4_real gs4i_node_mixing(const gs4_sim *sim, size_t node)
{
    const gs4i_conduction *k = &sim->conduction;
    const gs4_real inv_h = sim->grid.inv_h,
                   inv_cell = 1 / (sim->grid.h * sim->grid.h * sim->grid.h),
                   *q = k->heat_nodes + node;
    const gs4_real all = k->heat_sources ? k->heat_sources[node + GS4I_SOURCE_MIXING]
                                         : GS4I_MIXING * q[GS4I_NODE_VOLUME] * q[GS4I_NODE_VOLUME]
                                               / q[GS4I_NODE_RESISTANCE] * inv_h * inv_h;
    return gs4i_min(all / q[GS4I_NODE_CAPACITY], GS4I_C(0.5) / sim->heat_integrator.dt)
           * q[GS4I_NODE_CAPACITY] * inv_cell;
}

/* What particles gave to the nodes of a group of blocks, into the box. */
static void gs4i_heat_to_box(int index, void *context)
{
    const gs4i_node_pass *pass = (const gs4i_node_pass *)context;
    const gs4_sim *sim = pass->sim;
    const gs4i_grid *g = &sim->grid;
    const gs4i_conduction *k = &sim->conduction;
    const gs4_real inv_cell = 1 / (g->h * g->h * g->h),
                   /* of the lightest material, m^3: what is below has no mass but rounding */
        least = pass->lightest * sim->integrator.inv_node_mass * (g->h * g->h * g->h);
    int s, i;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        int first[3], x[3], at[3];
        gs4i_block_origin(g, g->block[s], first);
        for (i = 0; i < GS4I_BLOCK_NODES; i++) {
            const size_t node = 4 * ((size_t)s * GS4I_BLOCK_NODES + (size_t)i);
            const gs4_real *q = k->heat_nodes + node;
            size_t cell;
            gs4i_node_coordinates(first, i, x);
            if (!gs4i_box_cell_at(&k->box, x, at, &cell)) continue;
            if (!(q[GS4I_NODE_VOLUME] > least) || !(q[GS4I_NODE_CAPACITY] > 0)) continue;
            k->system.kind[cell] = GS4_CELL_LIQUID;
            k->temperature[cell] = q[GS4I_NODE_HEAT] / q[GS4I_NODE_CAPACITY];
            /* harmonic mean: materials of one node conduct in series */
            k->conductivity[cell] = q[GS4I_NODE_VOLUME] / q[GS4I_NODE_RESISTANCE];
            k->fill_fraction[cell] = q[GS4I_NODE_VOLUME] * inv_cell;
            k->mixing[cell] = gs4i_node_mixing(sim, node);
            k->capacity[cell] = k->system.diagonal[cell] = q[GS4I_NODE_CAPACITY] * inv_cell;
            k->system.rhs[cell] = k->heat_sources ? k->heat_sources[node + GS4I_SOURCE_POWER]
                                                        * inv_cell * sim->heat_integrator.s
                                                  : GS4I_C(0);
        }
    }
}

/* --- the equation ----------------------------------------------------------------------------- */

/* c of the faces of one plane of the box. */
static void gs4i_heat_faces(int z, void *context)
{
    const gs4_sim *sim = ((const gs4i_node_pass *)context)->sim;
    const gs4i_conduction *k = &sim->conduction;
    const gs4i_box *box = &k->box;
    const gs4_real *K = k->conductivity, *fill = k->fill_fraction, s = sim->heat_integrator.s;
    size_t step = 1, face;
    int axis, at[3];
    for (axis = 0; axis < 3; step *= (size_t)box->size[axis], axis++) {
        const int n = box->size[axis], periodic = box->periodic[axis];
        gs4_real *c = k->system.face[axis];
        if (z == box->size[2] && axis != 2) continue;
        GS4I_BOX_PLANE(box, 1 << axis, z, at, face) {
            size_t i = gs4i_box_index(box, GS4I_AT_CELL, at[0], at[1], at[2]), j = i - step;
            c[face] = 0;
            if ((at[axis] == 0 || at[axis] == n) && !periodic) continue;
            if (at[axis] == 0) j = i + step * (size_t)(n - 1);
            if (at[axis] == n) i -= step * (size_t)n;
            if (K[i] > 0 && K[j] > 0)
                c[face] = s * K[i] * (K[j] / (K[i] + K[j])) * (fill[i] + fill[j]);
        }
    }
}

/* Faces below this share of the best one are closed. The solver takes a contrast of 1e30; nodes
 * that are nearly empty and insulators (GS4I_LEAST_CONDUCTIVITY) make more. 1e-25 of a flow is
 * nothing. */
#define GS4I_NEGLIGIBLE_FACE GS4I_C(1e-25)

static void gs4i_close_negligible_faces(const gs4i_conduction *k)
{
    gs4_real most = 0;
    int axis, pass;
    for (pass = 0; pass < 2; pass++)
        for (axis = 0; axis < 3; axis++) {
            const size_t n = gs4i_box_count(&k->box, 1 << axis);
            gs4_real *c = k->system.face[axis];
            size_t i;
            if (!pass)
                for (i = 0; i < n; i++) most = gs4i_max(most, c[i]);
            else
                for (i = 0; i < n; i++)
                    if (c[i] < GS4I_NEGLIGIBLE_FACE * most) c[i] = 0;
        }
}

/* The temperature (K) that an empty node x has for its neighbours, if any: of a body there, or of
 * the air. */
static int gs4i_is_isothermal_at(const gs4_sim *sim, const int x[3], gs4_real *T)
{
    const gs4_vec3 p = gs4i_place_position(&sim->grid, x, GS4I_AT_CELL);
    int b;
    for (b = 0; b < sim->boundary.collider_count; b++) {
        const gs4i_collider *collider = &sim->boundary.colliders[b];
        if (collider->is_emitter
            || !(gs4i_collider_distance(collider, p) < GS4I_C(0.5) * sim->grid.h))
            continue;
        *T = collider->is.temperature;
        return collider->is.is_isothermal;
    }
    *T = sim->desc.ambient_temperature;
    return sim->desc.air_is_isothermal;
}

/* Surface that a cell shows towards each side, fill_i - fill_j where the neighbour j is emptier,
 * in h^2; none towards a wall. Only where material ends within three cells: a difference inside
 * is noise of the particles. The most of them. */
static gs4_real gs4i_shown_surface(const gs4i_conduction *k, const int at[3], size_t i,
                                   gs4_real shown[6])
{
    gs4_real most = 0;
    size_t j;
    int side;
    for (side = 0; side < 6; side++) {
        const gs4_real *fill = k->fill_fraction;
        shown[side] = 0;
        if (!k->surface_is_isothermal || gs4i_box_at_wall(&k->box, at, side)) continue;
        if (gs4i_box_beyond(&k->box, at, side, 3, &j) && !(fill[j] < GS4I_C(0.5))) continue;
        shown[side] = gs4i_max(
            fill[i] - (gs4i_box_beyond(&k->box, at, side, 1, &j) ? fill[j] : GS4I_C(0)), GS4I_C(0));
        most = gs4i_max(most, shown[side]);
    }
    return most;
}

/* Cells from a node to an isothermal surface, mean over the nodes that show it. Derived: steady
 * heat to a flat surface in 1D, with these c_f and links and the fill fractions of a half space,
 * meets the given temperature at the surface for 0.828, the mean over all places of the surface
 * in a cell. There it is off by less than 0.007 cells for 0.83, and by 0.39 for the mean
 * distance itself, 0.5. */
#define GS4I_SURFACE_DEPTH GS4I_C(0.83)

/* Links of one cell to isothermal walls, air and bodies: their sum, 1/h^2, and in `heat` that of
 * link times temperature. With n the normal that the cell shows, a surface that is shown along
 * several axes counts once, by the share |n_a|, and is nearer: half a step towards a neighbour
 * is |n_a|/2 along n, in the mean over shares n_a^2 sum |n_a|^3 / 2 and not 1/2. */
static gs4_real gs4i_isothermal_links(const gs4_sim *sim, const int at[3], gs4_real *heat)
{
    const gs4i_conduction *k = &sim->conduction;
    const size_t cell = gs4i_box_index(&k->box, GS4I_AT_CELL, at[0], at[1], at[2]);
    const gs4_real fill = k->fill_fraction[cell];
    gs4_real shown[6], all = 0, T = 0, most;
    int side, a, x[3];
    *heat = 0;
    for (side = 0; side < 6; side++)
        if (sim->desc.wall_is_isothermal[side] && gs4i_box_at_wall(&k->box, at, side)) {
            all += 2 * fill;
            *heat += 2 * fill * sim->desc.wall_temperature[side];
        }
    most = gs4i_shown_surface(k, at, cell, shown);
    for (side = 0; side < 6; side++) {
        /* of `most`: what a node with next to no mass shows has no square in float */
        const gs4_real own = most > 0 ? shown[side] / most : GS4I_C(0);
        gs4_real square = own * own, cube = square * own, norm, link;
        if (!(shown[side] > 0)) continue;
        for (a = 0; a < 3; a++) {
            const gs4_real other = gs4i_max(shown[2 * a], shown[2 * a + 1]) / most;
            if (a != side / 2) {
                square += other * other;
                cube += other * other * other;
            }
            x[a] = at[a] + k->box.low[a];
        }
        x[side / 2] += side & 1 ? 1 : -1;
        if (k->box.periodic[side / 2])
            x[side / 2] = (x[side / 2] + k->box.end[side / 2]) % k->box.end[side / 2];
        if (!gs4i_is_isothermal_at(sim, x, &T)) continue;
        norm = GS4I_SQRT(square);
        link = shown[side] * (own / norm)
               / (GS4I_SURFACE_DEPTH - GS4I_C(0.5) * (1 - cube / (square * norm)));
        all += link;
        *heat += link * T;
    }
    return all;
}

/* One plane of the box: links to isothermal boundaries, and what flows in at T**. */
static void gs4i_heat_equation(int z, void *context)
{
    const gs4_sim *sim = ((const gs4i_node_pass *)context)->sim;
    const gs4i_conduction *k = &sim->conduction;
    const gs4i_elliptic *e = &k->system;
    const gs4_real *T = k->temperature, per_area = sim->grid.inv_h * sim->grid.inv_h;
    size_t i;
    int at[3];
    GS4I_BOX_PLANE(&k->box, GS4I_AT_CELL, z, at, i) {
        gs4_real flow;
        if (e->kind[i] != GS4_CELL_LIQUID) continue;
        flow = gs4i_elliptic_inflow(e, T, at, i);
        if (k->boundary_is_isothermal) {
            gs4_real link, heat;
            link =
                gs4i_isothermal_links(sim, at, &heat) * sim->heat_integrator.s * k->conductivity[i];
            e->diagonal[i] += per_area * link;
            flow += sim->heat_integrator.s * k->conductivity[i] * heat - link * T[i];
        }
        e->rhs[i] += per_area * flow;
    }
}

static int gs4i_solve_heat_equation(gs4_sim *sim)
{
    gs4i_elliptic *e = &sim->conduction.system;
    const int result = gs4i_elliptic_solve(e, &sim->desc);
    if (result == GS4_OK) return GS4_OK;
    if (result == GS4_ERROR_MEMORY) return gs4i_fail_memory(&sim->error);
    if (result == GS4_ERROR_NOT_CONVERGED)
        return gs4i_fail_value(
            &sim->error, result, "the heat of the step did not converge: the residual is ",
            e->residual,
            " of the heat that flows (solver_tolerance, solver_max_iterations); the step was not "
            "taken; a larger tolerance, more iterations or a smaller dt would do");
    return gs4i_fail_value(
        &sim->error, GS4_ERROR_UNSTABLE, e->solver.fault, e->solver.fault_value,
        " of the heat of the step, which is not finite or absurd; the step was not taken; smaller "
        "conductivities, temperatures or heat capacities would do");
}

/* --- back to the nodes ------------------------------------------------------------------------ */

/* Second differences along the three axes of a field at a cell, h^2 d2/da2; a neighbour counts
 * by its share of `weight`. Beyond isothermal walls the field mirrors oddly, by `wall` of them
 * (NULL: about 0). Their sum. */
static gs4_real gs4i_second_differences(const gs4_sim *sim, const gs4_real *field,
                                        const gs4_real *weight, const gs4_real *wall,
                                        const int at[3], gs4_real difference[3])
{
    const gs4i_box *box = &sim->conduction.box;
    const size_t i = gs4i_box_index(box, GS4I_AT_CELL, at[0], at[1], at[2]),
                 step[3] = { 1, (size_t)box->size[0], (size_t)box->size[0] * (size_t)box->size[1] };
    const gs4_real inverse = 1 / weight[i];
    int axis, end;
    for (axis = 0; axis < 3; axis++) {
        const size_t round = step[axis] * (size_t)(box->size[axis] - 1);
        size_t to[2];
        difference[axis] = 0;
        to[0] = at[axis] > 0 ? i - step[axis] : i + round;
        to[1] = at[axis] < box->size[axis] - 1 ? i + step[axis] : i - round;
        for (end = 0; end < 2; end++)
            if (at[axis] == (end ? box->size[axis] - 1 : 0) && !box->periodic[axis]) {
                const int side = 2 * axis + end;
                if (sim->desc.wall_is_isothermal[side] && gs4i_box_at_wall(box, at, side))
                    difference[axis] += 2 * ((wall ? wall[side] : 0) - field[i]);
            } else
                difference[axis] +=
                    gs4i_min(weight[to[end]] * inverse, GS4I_C(1)) * (field[to[end]] - field[i]);
    }
    return difference[0] + difference[1] + difference[2];
}

/* The second differences of T** that mixing needs twice, of one plane of the box. They take the
 * place of the right-hand side, which is done with. */
static void gs4i_heat_curvature(int z, void *context)
{
    const gs4_sim *sim = ((const gs4i_node_pass *)context)->sim;
    const gs4i_conduction *k = &sim->conduction;
    gs4_real along[3];
    size_t i;
    int at[3];
    GS4I_BOX_PLANE(&k->box, GS4I_AT_CELL, z, at, i)
        if (k->mixing[i] > 0)
            k->system.rhs[i] = gs4i_second_differences(sim, k->temperature, k->mixing,
                                                       sim->desc.wall_temperature, at, along);
}

/* What particles gather, on the nodes of a group of blocks. A field scattered and gathered is
 * f + (h^2/4) lap f, half of that from each way (the second moment of the kernel is h^2/4). More of
 * it: the kernel's spectrum is sinc^3, there and back sinc^6 = 1 - q^2/4 + 7/240 q^4 with q = h k,
 * and with second differences D, -q^2 + q^4/12, the inverse is 1 - D/4 + 13/240 D^2.
 *     nodes:   x - (h^2/4) lap x;  rate of mixing r_mix (1/s);
 *              r_mix (1 - D/4 + 13/240 D^2) T** (K/s);  0
 *     sources, for the flux: T~ - (h^2/4) lap T~ + (h^2/12) d2T~/da2 for each axis a, whose
 *              gradient there and back is the second difference of the box; 1/k_eff (m K/W) */
static void gs4i_heat_from_box(int index, void *context)
{
    const gs4i_node_pass *pass = (const gs4i_node_pass *)context;
    const gs4_sim *sim = pass->sim;
    const gs4i_grid *g = &sim->grid;
    const gs4i_conduction *k = &sim->conduction;
    const gs4_real *change = k->system.x, *T = k->temperature, *wall = sim->desc.wall_temperature;
    int s, i, a;
    for (s = index * GS4I_GROUP; s < gs4i_group_end(g, index); s++) {
        int first[3], x[3], at[3];
        gs4i_block_origin(g, g->block[s], first);
        for (i = 0; i < GS4I_BLOCK_NODES; i++) {
            const size_t node = 4 * ((size_t)s * GS4I_BLOCK_NODES + (size_t)i);
            const gs4_real capacity =
                k->heat_nodes[node + GS4I_NODE_CAPACITY] * g->inv_h * g->inv_h * g->inv_h;
            gs4_real *q = k->heat_nodes + node,
                     *flux = sim->particles.with_flux ? k->heat_sources + node : NULL, change_2[3],
                     T_2[3], sum;
            size_t cell;
            gs4i_node_coordinates(first, i, x);
            memset(q, 0, 4 * sizeof *q);
            if (flux) memset(flux, 0, 4 * sizeof *flux);
            if (!gs4i_box_cell_at(&k->box, x, at, &cell) || k->system.kind[cell] != GS4_CELL_LIQUID)
                continue;
            sum = gs4i_second_differences(sim, change, k->capacity, NULL, at, change_2);
            q[GS4I_NODE_CHANGE] = change[cell] - GS4I_C(0.25) * sum;
            if (k->mixing[cell] > 0) {
                q[GS4I_NODE_MIXING_RATE] = k->mixing[cell] / capacity;
                q[GS4I_NODE_MIXING_TARGET] =
                    q[GS4I_NODE_MIXING_RATE]
                    * ((T[cell] - GS4I_C(0.25) * k->system.rhs[cell])
                       + GS4I_C(13.0 / 240)
                             * gs4i_second_differences(sim, k->system.rhs, k->mixing, NULL, at,
                                                       T_2));
            }
            if (!flux) continue;
            sum += gs4i_second_differences(sim, T, k->capacity, wall, at, T_2);
            flux[GS4I_SOURCE_RESISTANCE] = 1 / k->conductivity[cell];
            for (a = 0; a < 3; a++)
                flux[a] = T[cell] + change[cell] - GS4I_C(0.25) * sum
                          + GS4I_C(1.0 / 12) * (T_2[a] + change_2[a]);
        }
    }
}

/* --- memory, and all of it -------------------------------------------------------------------- */

static void gs4i_free_conduction(gs4i_memory *m, gs4i_conduction *k)
{
    const size_t node = GS4I_NODE_REALS * sizeof(gs4_real), slots = (size_t)k->slots;
    gs4i_free(m, k->heat_nodes, slots, node);
    gs4i_free(m, k->heat_sources, slots, node);
    gs4i_box_free(m, &k->box);
    k->system.solver.memory = m;
    gs4i_solver_free(&k->system.solver);
}

/* Room for the heat of every node that exists. */
static int gs4i_reserve_conduction(gs4_sim *sim)
{
    gs4i_conduction *k = &sim->conduction;
    gs4i_memory *m = &sim->memory;
    const size_t node = GS4I_NODE_REALS * sizeof(gs4_real), slots = (size_t)sim->grid.capacity;
    const int wants_source = sim->particles.with_flux || k->with_viscous_heating;
    gs4_real *heat_nodes, *heat_sources;
    if (!sim->particles.with_heat
        || (k->slots >= sim->grid.active && (k->heat_sources || !wants_source)))
        return GS4_OK;
    heat_nodes = (gs4_real *)gs4i_alloc(m, slots, node);
    heat_sources = wants_source ? (gs4_real *)gs4i_alloc(m, slots, node) : NULL;
    if (!heat_nodes || (wants_source && !heat_sources)) {
        gs4i_free(m, heat_nodes, slots, node);
        gs4i_free(m, heat_sources, slots, node);
        return GS4_ERROR_MEMORY;
    }
    gs4i_free(m, k->heat_nodes, (size_t)k->slots, node);
    gs4i_free(m, k->heat_sources, (size_t)k->slots, node);
    k->heat_nodes = heat_nodes;
    k->heat_sources = heat_sources;
    k->slots = sim->grid.capacity;
    return GS4_OK;
}

/* T~ on the nodes. Nothing that lasts is written. */
static int gs4i_solve_heat(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_conduction *k = &sim->conduction;
    const double start = gs4i_now(sim);
    int result;
    gs4i_fold_heat(sim);
    if (gs4i_begin_conduction(sim) != GS4_OK) return gs4i_fail_memory(&sim->error);
    gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_heat_to_box, nodes);
    gs4i_parallel_for(&sim->tasks, k->box.size[2] + 1, gs4i_heat_faces, nodes);
    gs4i_close_negligible_faces(k);
    gs4i_parallel_for(&sim->tasks, k->box.size[2], gs4i_heat_equation, nodes);
    result = gs4i_solve_heat_equation(sim);
    if (result != GS4_OK) return result;
    gs4i_parallel_for(&sim->tasks, k->box.size[2], gs4i_heat_curvature, nodes);
    gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_heat_from_box, nodes);
    gs4i_fill_heat(sim);
    sim->seconds[GS4I_CLOCK_SOLVE] += gs4i_since(sim, start);
    return GS4_OK;
}

/* ==== [[scene]] materials, particles in shapes, colliders, emitters ============================ *
 *
 * What is given to a simulation, once it is checked ([[public]]): a call adds all of it or
 * nothing. Emitters work within a step: gs4i_prepare_emitters when it begins, gs4i_emit when it
 * ends. */

/* --- materials -------------------------------------------------------------------------------- */

/* Speed of sound, m/s. Where none is given: ten times the fastest that anything here moves, falls
 * or flows down, since compression goes as the Mach number squared: 1 %. Of lighter materials so
 * much more that the pressure of the densest one compresses them no more than itself. Of solids
 * also at least sqrt(10 G/rho): a bulk modulus of 10 shear moduli, Poisson's ratio 0.45. */
static double gs4i_sound_speed_of(const gs4_sim_desc *d, const gs4_material *m, gs4_real top_speed,
                                  double densest)
{
    const double size = (double)d->cell_size;
    const double fall = fabs((double)d->gravity.x) * d->cells[0] * size
                        + fabs((double)d->gravity.y) * d->cells[1] * size
                        + fabs((double)d->gravity.z) * d->cells[2] * size;
    double speed = sqrt(2 * fall + (double)top_speed * (double)top_speed);
    if (m->sound_speed > 0) return (double)m->sound_speed;
    if (m->bulk_modulus > 0) return sqrt((double)m->bulk_modulus / (double)m->density);
    if (speed <= 0) speed = size; /* nothing moves so far: a cell a second is as good as any */
    return fmax(10 * speed * sqrt(densest / (double)m->density),
                sqrt(10 * (double)m->shear_modulus / (double)m->density));
}

/* rho0 c0^2 / 7 of (3), Pa. */
static gs4_real gs4i_tait_of(const gs4_material *m, double sound_speed)
{
    return GS4I_C((double)m->density * sound_speed * sound_speed / 7);
}

/* Greatest density of the materials, or the least where `sign` is -1; 0: there are none. */
static double gs4i_extreme_density(const gs4_sim *sim, int sign)
{
    double most = 0;
    int i;
    for (i = 0; i < sim->material_count; i++) {
        const double density = (double)sim->constants[i].is.density;
        if (i == 0 || sign * (density - most) > 0) most = density;
    }
    return most;
}

/* GS4: a particle among much lighter ones swings alone against the nodes, as in symplectic Euler,
 * where sum |grad w|^2/w = 12/h^2. Lighter nodes give way: a particle of mass m_p in nodes of mass
 * m_i has 12/h^2 / (1 + 3 m_i/m_p), 3/h^2 in its own material. Measured for density ratios of 10,
 * 30, 100 and 1000, 8 particles a cell: 3.3, 4.9, 7.1, 11 (this: 3.5, 6.7, 9.7, 11.7); of 10 with
 * heavy ones a cell wide: 5.5 (this: 9.2). How often the squared speed of waves counts by that. */
static gs4_real gs4i_lone_waves(const gs4_sim *sim, const gs4_material *m)
{
    const double most = GS4I_EULER_SOUND_EIGENVALUE / GS4I_SOUND_EIGENVALUE,
                 h = (double)sim->grid.h;
    const double cell = h * h * h, mass = fmin((double)sim->max_mass, (double)m->density * cell),
                 node = gs4i_extreme_density(sim, -1) * cell;
    if (sim->desc.scheme != GS4_EXPLICIT || !sim->particles.with_rates || !(mass > 0)) return 1;
    return GS4I_C(fmax(1, most / (1 + (most - 1) * node / mass)));
}

static void gs4i_set_constants(gs4_sim *sim)
{
    int i;
    for (i = 0; i < sim->material_count; i++) {
        gs4i_material_constants *l = &sim->constants[i];
        const double c0 =
            gs4i_sound_speed_of(&sim->desc, &l->is, sim->top_speed, gs4i_extreme_density(sim, 1));
        l->sound_speed = l->tait = l->compliance = 0;
        l->lone = gs4i_lone_waves(sim, &l->is);
        if (sim->desc.scheme == GS4_EXPLICIT) {
            l->sound_speed = GS4I_C(c0);
            l->tait = gs4i_tait_of(&l->is, c0);
        } else if (!l->is.incompressible)
            l->compliance = GS4I_C(1 / ((double)l->is.density * c0 * c0));
        gs4i_set_material_constants(l, sim->desc.ambient_temperature);
        sim->solid_phase[i] = *l;
        gs4i_set_solid_phase(&sim->solid_phase[i]);
    }
    sim->limits_stale = 1;
}

/* Default speeds of sound follow the greatest speed (m/s) that was ever set. */
static void gs4i_note_speed(gs4_sim *sim, gs4_real speed)
{
    if (speed > sim->top_speed) {
        sim->top_speed = speed;
        gs4i_set_constants(sim);
    }
}

/* What the mass of a new particle says of scales: see gs4i_lone_waves. */
static void gs4i_note_mass(gs4_sim *sim, gs4_real mass)
{
    int i;
    sim->min_mass = sim->min_mass > 0 ? gs4i_min(sim->min_mass, mass) : mass;
    if (mass <= sim->max_mass) return;
    sim->max_mass = mass;
    for (i = 0; i < sim->material_count; i++) {
        const gs4_real lone = gs4i_lone_waves(sim, &sim->constants[i].is);
        if (lone == sim->constants[i].lone) continue;
        sim->constants[i].lone = sim->solid_phase[i].lone = lone;
        sim->limits_stale = 1;
    }
}

/* Speed of the fastest particle; one that is not finite does not count. */
static gs4_real gs4i_top_speed(const gs4i_particles *p)
{
    gs4_real top = 0;
    int i;
    for (i = 0; i < p->count; i++) {
        const gs4_real *v = p->velocity + 4 * (size_t)i,
                       speed = gs4i_length(gs4i_vec3(v[0], v[1], v[2]));
        if (speed > top && speed < GS4I_HUGE) top = speed;
    }
    return top;
}

/* A scene carries heat from the first material on that conducts it, melts or is heated by
 * viscosity. */
static int gs4i_has_heat(const gs4_material *m)
{
    return m->conductivity > 0 || m->can_melt || m->viscous_heating;
}

/* From the first viscoelastic material on particles carry non-local stress. */
static int gs4i_make_elastic(gs4_sim *sim)
{
    gs4i_particles *p = &sim->particles;
    const int reals = p->with_rates ? 12 : 6;
    if (p->elastic_reals) return GS4_OK;
    if (p->capacity
        && !(p->elastic = (gs4_real *)gs4i_alloc(&sim->memory, (size_t)p->capacity + 1,
                                                 (size_t)reals * sizeof(gs4_real))))
        return GS4_ERROR_MEMORY;
    p->elastic_reals = reals;
    return GS4_OK;
}

/* From the first material with heat on particles carry a temperature, those that are there
 * already that of the air; from the first with a flux relaxation time on, a flux. */
static int gs4i_make_heat(gs4_sim *sim, const gs4_material *material)
{
    gs4i_particles *p = &sim->particles;
    const size_t room = (size_t)p->capacity + 1, each = 4 * sizeof(gs4_real);
    const int heat = !p->with_heat, flux = !p->with_flux && material->flux_relaxation_time > 0;
    gs4_real *made[3] = { NULL, NULL, NULL };
    uint8_t *liquid = NULL;
    int i;
    if (p->capacity) {
        if (heat) {
            made[0] = (gs4_real *)gs4i_alloc(&sim->memory, room, each);
            liquid = (uint8_t *)gs4i_alloc(&sim->memory, room, 1);
        }
        if (flux) {
            made[1] = (gs4_real *)gs4i_alloc(&sim->memory, room, each);
            made[2] = (gs4_real *)gs4i_alloc(&sim->memory, room, each);
        }
        if ((heat && (!made[0] || !liquid)) || (flux && (!made[1] || !made[2]))) {
            for (i = 0; i < 3; i++) gs4i_free(&sim->memory, made[i], room, each);
            gs4i_free(&sim->memory, liquid, room, 1);
            return GS4_ERROR_MEMORY;
        }
    }
    if (heat) {
        p->heat = made[0];
        p->liquid = liquid;
        p->with_heat = 1;
    }
    for (i = 0; i < p->count && heat; i++)
        gs4i_begin_heat(p, (size_t)i, &sim->constants[p->material[i]],
                        sim->desc.ambient_temperature);
    if (flux) {
        p->flux = made[1];
        p->flux_rate = made[2];
        p->with_flux = 1;
    }
    sim->conduction.with_viscous_heating |= material->viscous_heating != 0;
    sim->needs_sort = 1; /* nodes need room for it, too */
    return GS4_OK;
}

/* From the first solid on particles carry F; those that are there already, the one that their
 * volume ratio says. */
static int gs4i_make_deformation(gs4_sim *sim)
{
    gs4i_particles *p = &sim->particles;
    const int reals = p->with_rates ? 24 : 9;
    int i;
    if (p->deformation_reals) return GS4_OK;
    if (p->capacity
        && !(p->deformation = (gs4_real *)gs4i_alloc(&sim->memory, (size_t)p->capacity + 1,
                                                     (size_t)reals * sizeof(gs4_real))))
        return GS4_ERROR_MEMORY;
    p->deformation_reals = reals;
    for (i = 0; i < p->count; i++) gs4i_undeform(p, (size_t)i, p->velocity[4 * (size_t)i + 3]);
    return GS4_OK;
}

/* All that particles carry from this material on, or nothing of it. */
static int gs4i_make_history(gs4_sim *sim, const gs4_material *material)
{
    gs4i_particles *p = &sim->particles;
    const gs4i_particles before = *p;
    int result = material->liquid != GS4_NEWTONIAN ? gs4i_make_elastic(sim) : GS4_OK;
    if (result == GS4_OK && material->solid != GS4_NO_SOLID) result = gs4i_make_deformation(sim);
    if (result == GS4_OK && gs4i_has_heat(material)) result = gs4i_make_heat(sim, material);
    if (result == GS4_OK) return GS4_OK;
    if (p->elastic != before.elastic)
        gs4i_free(&sim->memory, p->elastic, (size_t)p->capacity + 1,
                  (size_t)p->elastic_reals * sizeof(gs4_real));
    if (p->deformation != before.deformation)
        gs4i_free(&sim->memory, p->deformation, (size_t)p->capacity + 1,
                  (size_t)p->deformation_reals * sizeof(gs4_real));
    *p = before;
    return result;
}

/* All members, and nothing of what lies between them: checkpoints compare materials byte by
 * byte. */
static void gs4i_copy_members(gs4_material *to, const gs4_material *m)
{
    to->density = m->density;
    to->liquid = m->liquid;
    to->viscosity = m->viscosity;
    to->local_fraction = m->local_fraction;
    to->relaxation_time = m->relaxation_time;
    to->stretch_time = m->stretch_time;
    to->anisotropy = m->anisotropy;
    to->arms = m->arms;
    to->viscosity_law = m->viscosity_law;
    to->cross_wlf.a = m->cross_wlf.a;
    to->cross_wlf.n = m->cross_wlf.n;
    to->cross_wlf.d1 = m->cross_wlf.d1;
    to->cross_wlf.a1 = m->cross_wlf.a1;
    to->cross_wlf.t1 = m->cross_wlf.t1;
    to->cross_wlf.t2 = m->cross_wlf.t2;
    to->viscosity_fn = m->viscosity_fn;
    to->viscosity_user = m->viscosity_user;
    to->herschel_bulkley.yield_stress = m->herschel_bulkley.yield_stress;
    to->herschel_bulkley.consistency = m->herschel_bulkley.consistency;
    to->herschel_bulkley.index = m->herschel_bulkley.index;
    to->herschel_bulkley.creep_rate = m->herschel_bulkley.creep_rate;
    to->bulk_modulus = m->bulk_modulus;
    to->sound_speed = m->sound_speed;
    to->incompressible = m->incompressible;
    to->solid = m->solid;
    to->shear_modulus = m->shear_modulus;
    to->yield_compression = m->yield_compression;
    to->yield_stretch = m->yield_stretch;
    to->heat_capacity = m->heat_capacity;
    to->conductivity = m->conductivity;
    to->flux_relaxation_time = m->flux_relaxation_time;
    to->fourier_fraction = m->fourier_fraction;
    to->melting_temperature = m->melting_temperature;
    to->latent_heat = m->latent_heat;
    to->can_melt = m->can_melt;
    to->viscous_heating = m->viscous_heating;
}

/* Its id, or an error. */
/* Gravity from now on. Where it is less than before, default speeds of sound stay: particles have
 * their J by them. Rates are of what was. */
static void gs4i_set_gravity(gs4_sim *sim, gs4_vec3 gravity)
{
    const gs4_real top = sim->top_speed;
    gs4_material any;
    double before, after;
    memset(&any, 0, sizeof any);
    any.density = 1;
    before = gs4i_sound_speed_of(&sim->desc, &any, top, 1) / 10;
    sim->desc.gravity = gravity;
    after = gs4i_sound_speed_of(&sim->desc, &any, top, 1) / 10;
    if (after < before)
        sim->top_speed = GS4I_C(sqrt(before * before - after * after + (double)top * (double)top));
    gs4i_set_constants(sim);
}

static int gs4i_add_material(gs4_sim *sim, const gs4_material *m)
{
    gs4i_material_constants *of_liquid, *of_solid;
    of_liquid =
        (gs4i_material_constants *)gs4i_grow(&sim->memory, sim->constants, sim->material_count,
                                             &sim->material_capacity, sizeof *of_liquid);
    if (!of_liquid) return gs4i_fail_memory(&sim->error);
    sim->constants = of_liquid;
    of_solid =
        (gs4i_material_constants *)gs4i_grow(&sim->memory, sim->solid_phase, sim->material_count,
                                             &sim->solid_phase_capacity, sizeof *of_solid);
    if (!of_solid) return gs4i_fail_memory(&sim->error);
    sim->solid_phase = of_solid;
    if (gs4i_make_history(sim, m) != GS4_OK) return gs4i_fail_memory(&sim->error);
    memset(&sim->constants[sim->material_count].is, 0, sizeof *m);
    gs4i_copy_members(&sim->constants[sim->material_count++].is, m);
    gs4i_set_constants(sim);
    return sim->material_count - 1;
}

/* --- particles -------------------------------------------------------------------------------- */

/* One particle at rest with its surroundings: J 1, no rates, no stress. 0: there is no room. */
static int gs4i_add_particle(gs4_sim *sim, gs4_vec3 x, gs4_vec3 v, gs4_real mass, const gs4_fill *f)
{
    gs4i_particles *p = &sim->particles;
    const size_t i = (size_t)p->count, real = sizeof(gs4_real);
    gs4_real *position = p->position + 4 * i, *velocity = p->velocity + 4 * i;
    int k;
    if (p->count >= p->capacity || sim->next_id == UINT32_MAX) return 0;
    position[0] = x.x;
    position[1] = x.y;
    position[2] = x.z;
    position[3] = mass;
    velocity[0] = v.x;
    velocity[1] = v.y;
    velocity[2] = v.z;
    velocity[3] = 1;
    if (p->with_rates) {
        memset(p->rate + 4 * i, 0, 4 * real);
        memset(p->position_residual + 4 * i, 0, 4 * sizeof(gs4i_half));
    }
    for (k = 0; k < 3 && p->affine[k]; k++) memset(p->affine[k] + 4 * i, 0, 4 * real);
    for (k = 0; k < 3 && p->affine_before[k]; k++) memset(p->affine_before[k] + 4 * i, 0, 4 * real);
    if (p->elastic_reals)
        memset(p->elastic + (size_t)p->elastic_reals * i, 0, (size_t)p->elastic_reals * real);
    if (p->deformation_reals) gs4i_undeform(p, i, 1);
    if (p->with_heat) gs4i_begin_heat(p, i, &sim->constants[f->material], f->temperature);
    p->id[i] = sim->next_id++;
    p->material[i] = (uint8_t)f->material;
    p->count++;
    gs4i_note_mass(sim, mass);
    sim->needs_sort = 1;
    return 1;
}

/* The same with the rotation of a filling: v = velocity + omega x (x - centre), C = omega x. */
static void gs4i_fill_one(gs4_sim *sim, const gs4_real at[3], gs4_vec3 centre, const gs4_fill *f,
                          gs4_real mass)
{
    const gs4_vec3 w = f->angular_velocity, x = gs4i_vec3(at[0], at[1], at[2]);
    const gs4_real C[3][4] = { { 0, w.z, -w.y, 0 }, { -w.z, 0, w.x, 0 }, { w.y, -w.x, 0, 0 } };
    const size_t i = (size_t)sim->particles.count;
    const gs4_vec3 v = gs4i_add(f->velocity, gs4i_cross(w, gs4i_sub(x, centre)));
    /* the next step finds C from 0: see gs4i_find_affine */
    const int is_found = sim->needs_spin && sim->particles.with_affine_before;
    int k;
    if (!gs4i_add_particle(sim, x, v, mass, f)) return;
    for (k = 0; k < 3 && sim->particles.affine[k] && !is_found; k++)
        memcpy(sim->particles.affine[k] + 4 * i, C[k], sizeof C[k]);
    for (k = 0; k < 3 && sim->particles.affine_before[k] && !is_found; k++)
        memcpy(sim->particles.affine_before[k] + 4 * i, C[k], sizeof C[k]);
    if (sim->particles.deformation_reals && !sim->needs_spin)
        gs4i_set_spin(&sim->particles, i,
                      gs4i_constants_of(sim, i)->shear_modulus > 0 ? w : gs4i_vec3(0, 0, 0));
    gs4i_note_speed(sim, gs4i_length(v));
}

/* Deeper in a collider than rounding of surfaces that touch? */
static int gs4i_is_in_body(const gs4_sim *sim, const gs4_real x[3])
{
    int i;
    for (i = 0; i < sim->boundary.collider_count; i++)
        if (!sim->boundary.colliders[i].is_emitter
            && gs4i_collider_distance(&sim->boundary.colliders[i], gs4i_vec3(x[0], x[1], x[2]))
                   < GS4I_C(-0.1) * sim->grid.h)
            return 1;
    return 0;
}

/* Are any of n rows of `stride` numbers, places first, in a body? */
static void gs4i_warn_of_bodies(gs4_sim *sim, const gs4_real *x, int stride, int64_t n)
{
    int64_t i;
    if (!sim->boundary.collider_count || !gs4i_will_warn(sim, GS4I_WARN_INSIDE_BODY)) return;
    for (i = 0; i < n; i++)
        if (gs4i_is_in_body(sim, x + i * stride)) break;
    if (i < n)
        gs4i_warn(sim, GS4I_WARN_INSIDE_BODY,
                  "there is material inside of a collider: the first step puts it on its surface, "
                  "far too densely; leave the collider out of the filling");
}

/* What a filling of an emitter or of now is likely not meant to be. */
static void gs4i_warn_of_filling(gs4_sim *sim, const gs4_shape *shape, const gs4_fill *f)
{
    gs4_vec3 low = sim->grid.origin, high = low;
    double from[3], to[3], origin[3];
    int a, cut = 0;
    const gs4_material *m = &sim->constants[f->material].is;
    gs4i_shape_bounds(shape, &low, &high);
    gs4i_to_double(low, from);
    gs4i_to_double(high, to);
    gs4i_to_double(sim->grid.origin, origin);
    for (a = 0; a < 3; a++)
        cut |= from[a] < origin[a] - 0.01 * (double)sim->grid.h
               || to[a] > origin[a] + (sim->grid.cells[a] + 0.01) * (double)sim->grid.h;
    if (cut && shape->kind != GS4_SHAPE_SDF && shape->kind != GS4_SHAPE_PLANE)
        gs4i_warn(sim, GS4I_WARN_CUT_OFF,
                  "a shape of material reaches beyond the grid and is cut off at its walls");
    if (m->can_melt && f->temperature == 0)
        gs4i_warn_value(sim, GS4I_WARN_COLD,
                        "material that can melt begins at fill.temperature 0, the default; its "
                        "melting_temperature is ",
                        (double)m->melting_temperature, "");
}

/* There is no memory for so many. */
static int gs4i_fail_particles(gs4i_error *e, const gs4i_particles *p, double wanted)
{
    gs4i_particles store = *p;
    gs4i_array a[GS4I_ARRAYS];
    gs4i_text t = gs4i_begin_error(e);
    double each = 0;
    int i;
    gs4i_particle_arrays(&store, a);
    for (i = 0; i < GS4I_ARRAYS; i++)
        if (a[i].wanted) each += (double)a[i].size;
    gs4i_put(&t, "out of memory: ");
    gs4i_put_real(&t, wanted);
    gs4i_put(&t, " particles need ");
    gs4i_put_real(&t, each * wanted);
    gs4i_put(&t, " bytes; nothing has changed");
    return gs4i_end_error(e, GS4_ERROR_MEMORY);
}

/* Room for n more particles. */
static int gs4i_make_room(gs4_sim *sim, int64_t n)
{
    const int64_t wanted = sim->particles.count + n,
                  limit = sim->desc.max_particles ? sim->desc.max_particles : GS4I_MAX_PARTICLES;
    if (wanted > limit)
        return gs4i_fail_value(&sim->error, GS4_ERROR_MEMORY, "this needs room for ",
                               (double)wanted,
                               " particles, more than max_particles; nothing was added");
    if ((uint64_t)sim->next_id + (uint64_t)n >= UINT32_MAX)
        return gs4i_fail(&sim->error, GS4_ERROR_MEMORY, "all 2^32 particle ids are used up");
    if (gs4i_particles_reserve(&sim->memory, &sim->particles, (int)wanted) != GS4_OK)
        return gs4i_fail_particles(&sim->error, &sim->particles, (double)wanted);
    return GS4_OK;
}

/* After a change by hand the next step is a first step, without rates. With old ones nodes would
 * have alpha_f dt a from the prediction and acc_i in full on top, as ag_i is 0 there. The rates of
 * J, F and heat drop out of a step with alpha_m = gamma = 1 by themselves. */
static void gs4i_restart(gs4_sim *sim)
{
    gs4i_particles *p = &sim->particles;
    const size_t n = (size_t)p->count;
    size_t i;
    if (!sim->restart && p->with_rates && n > 0) {
        memset(p->rate, 0, 4 * n * sizeof *p->rate);
        memset(p->position_residual, 0, 4 * n * sizeof *p->position_residual);
        for (i = 0; i < n && p->elastic_reals; i++)
            memset(p->elastic + (size_t)p->elastic_reals * i + 6, 0, 6 * sizeof *p->elastic);
        for (i = 0; i < n && p->deformation_reals; i++)
            memset(p->deformation + (size_t)p->deformation_reals * i + 21, 0,
                   3 * sizeof *p->deformation);
    }
    sim->restart = sim->needs_sort = sim->limits_stale = 1;
}

/* Particles of `mass` (kg) at xyz, which turn about `centre`. How many, or an error. */
static int gs4i_add_points(gs4_sim *sim, const gs4_real *xyz, int64_t count, gs4_real mass,
                           gs4_vec3 centre, const gs4_fill *f)
{
    int64_t i;
    if (!(mass > GS4I_TINY / GS4I_EPSILON))
        return gs4i_fail(&sim->error, GS4_ERROR_ARGUMENT,
                         "a particle would be lighter than gs4_real can tell from nothing; use "
                         "other units, or define GS4_DOUBLE");
    GS4I_TRY(gs4i_make_room(sim, count));
    for (i = 0; i < count; i++) gs4i_fill_one(sim, xyz + 3 * i, centre, f, mass);
    if (count) gs4i_restart(sim);
    return (int)count;
}

/* --- points of a lattice in a shape ----------------------------------------------------------- */

/* Point n of a lattice is at low + (n + 1/2) spacing, and jitter displaces it. All lattices are
 * aligned with the cells. */
typedef struct gs4i_lattice {
    const gs4i_collider *shape;
    const gs4_fill *fill;
    double low[3];
    int64_t from[3], to[3], n[3]; /* from <= n < to; the present point */
} gs4i_lattice;

/* Uniform in [-1/2, 1/2): what jitter displaces point n by along an axis, in spacings. */
static gs4_real gs4i_lattice_noise(const gs4_fill *f, const int64_t n[3], int axis)
{
    const uint64_t number = (uint64_t)n[0] + ((uint64_t)n[1] << 21) + ((uint64_t)n[2] << 42);
    const uint64_t u = gs4i_mix(gs4i_mix((uint64_t)f->random_seed << 32 ^ number) + (uint64_t)axis);
    return GS4I_C((double)(u >> 40) / 16777216.0 - 0.5);
}

/* Points in the box low..high where it meets the domain. 0: they do not meet. */
static int gs4i_lattice_span(gs4i_lattice *l, const gs4i_grid *g, const double low[3],
                             const double high[3])
{
    const double spacing = (double)l->fill->spacing;
    int a;
    for (a = 0; a < 3; a++) {
        const double size = g->cells[a] * (double)g->h, begin = fmax(low[a], l->low[a]),
                     end = fmin(high[a], l->low[a] + size);
        if (begin >= end) return 0;
        l->from[a] = (int64_t)floor((begin - l->low[a]) / spacing);
        l->to[a] = (int64_t)ceil((end - l->low[a]) / spacing);
        l->n[a] = a == 0 ? l->from[a] - 1 : l->from[a];
    }
    return 1;
}

/* To the next point; 0 behind the last one. */
static int gs4i_lattice_next(gs4i_lattice *l)
{
    int a;
    for (a = 0; a < 3; a++) {
        if (++l->n[a] < l->to[a]) return 1;
        l->n[a] = l->from[a];
    }
    return 0;
}

/* Of a particle of a filling, kg: a lattice cell of material. */
static gs4_real gs4i_mass_of(const gs4_sim *sim, const gs4_fill *f)
{
    return sim->constants[f->material].density * f->spacing * f->spacing * f->spacing;
}

/* Is the point `at` of the shape inside? */
static int gs4i_is_inside(const gs4i_collider *shape, const double at[3])
{
    return gs4i_shape_or_field(shape, gs4i_vec3(GS4I_C(at[0]), GS4I_C(at[1]), GS4I_C(at[2]))) < 0;
}

/* Does the box of a shape meet the domain? */
static int gs4i_meets_domain(const gs4i_grid *g, const gs4_shape *s)
{
    gs4_vec3 low, high;
    double from[3], to[3], origin[3];
    int a, meets = 1;
    gs4i_shape_bounds(s, &low, &high);
    gs4i_to_double(low, from);
    gs4i_to_double(high, to);
    gs4i_to_double(g->origin, origin);
    for (a = 0; a < 3; a++)
        meets &= fmax(from[a], origin[a]) < fmin(to[a], origin[a] + g->cells[a] * (double)g->h);
    return meets;
}

/* --- filling a shape -------------------------------------------------------------------------- */

/* The next point x of a filling that is in the shape. Jitter then displaces it, so that it does
 * not change how many there are. It may take them out of the shape, but not out of the domain. */
static int gs4i_next_filled(const gs4i_grid *g, gs4i_lattice *l, gs4_real x[3])
{
    const gs4_real amount = l->fill->jitter * l->fill->spacing;
    while (gs4i_lattice_next(l)) {
        double at[3];
        int a;
        for (a = 0; a < 3; a++)
            at[a] = l->low[a] + ((double)l->n[a] + 0.5) * (double)l->fill->spacing;
        if (!gs4i_is_inside(l->shape, at)) continue;
        for (a = 0; a < 3; a++) {
            x[a] = GS4I_C(at[a]);
            if (amount > 0) x[a] += amount * gs4i_lattice_noise(l->fill, l->n, a);
        }
        if (gs4i_is_in_domain(g, x)) return 1;
    }
    return 0;
}

/* The lattice of a filling; 0 where the shape and the domain do not meet. */
static int gs4i_fill_lattice(const gs4i_grid *g, const gs4i_collider *shape, const gs4_fill *f,
                             gs4i_lattice *l)
{
    gs4_vec3 low = g->origin, high = g->origin;
    double from[3], to[3];
    int a;
    memset(l, 0, sizeof *l);
    l->shape = shape;
    l->fill = f;
    gs4i_to_double(g->origin, l->low);
    gs4i_shape_bounds(&shape->is.shape, &low, &high);
    gs4i_to_double(low, from);
    gs4i_to_double(high, to);
    for (a = 0; a < 3; a++)
        if (shape->is.shape.kind == GS4_SHAPE_PLANE) to[a] += g->cells[a] * (double)g->h;
    return gs4i_lattice_span(l, g, from, to);
}

/* Is there material already where `count` new particles would go? A cell that they fill by a
 * good half must not be filled by as much before. -1: out of memory. */
static int gs4i_overlaps(gs4_sim *sim, const gs4i_lattice *l, const gs4_real *points, int count)
{
    const gs4i_particles *p = &sim->particles;
    const gs4_real o[3] = { sim->grid.origin.x, sim->grid.origin.y, sim->grid.origin.z };
    const gs4_real full = sim->grid.h * sim->grid.h * sim->grid.h,
                   volume = l->fill->spacing * l->fill->spacing * l->fill->spacing;
    const double ratio = (double)l->fill->spacing / (double)sim->grid.h;
    gs4_real *filled; /* of each cell, m^3: by what is there, by what is new */
    size_t i, cells = 1;
    int a, pass, overlap = 0, low[3], n[3];
    if (p->count == 0) return 0;
    for (a = 0; a < 3; a++) { /* the cells of all points, with one around for jitter */
        low[a] = (int)floor((double)l->from[a] * ratio) - 1;
        n[a] = (int)ceil((double)l->to[a] * ratio) + 1 - low[a];
        cells *= (size_t)n[a];
    }
    filled = (gs4_real *)gs4i_alloc(&sim->memory, cells, 2 * sizeof *filled);
    if (!filled) return -1;
    for (pass = 0; pass < 2; pass++)
        for (i = 0; i < (size_t)(pass ? count : p->count); i++) {
            const gs4_real *x = pass ? points + 3 * i : p->position + 4 * i;
            size_t at = 0;
            for (a = 2; a >= 0; a--) {
                const int c = (int)((x[a] - o[a]) * sim->grid.inv_h) - low[a];
                if (c < 0 || c >= n[a]) break;
                at = at * (size_t)n[a] + (size_t)c;
            }
            if (a >= 0) continue;
            filled[2 * at + (size_t)pass] += pass ? volume
                                                  : p->position[4 * i + 3]
                                                        * sim->constants[p->material[i]].inv_density
                                                        * p->velocity[4 * i + 3];
        }
    for (i = 0; i < cells; i++)
        overlap |= filled[2 * i] > GS4I_C(0.6) * full && filled[2 * i + 1] > GS4I_C(0.6) * full;
    gs4i_free(&sim->memory, filled, cells, 2 * sizeof *filled);
    return overlap;
}

/* Since `bad_distance` was 0: did all distance functions give numbers? */
static int gs4i_check_distances(gs4_sim *sim)
{
    return gs4i_require(&sim->error, !sim->bad_distance,
                        "shape: a distance function (gs4_sdf) gave NaN or infinity; it must give a "
                        "finite number (m) wherever it is asked; nothing has changed");
}

/* A shape at rest at its pivot; distances of a mesh are sampled every `spacing` (m). */
static int gs4i_make_collider(gs4_sim *sim, gs4i_collider *b, const gs4_collider *is,
                              double spacing)
{
    memset(b, 0, sizeof *b);
    b->is = *is;
    b->bad_distance = is->shape.kind == GS4_SHAPE_SDF ? &sim->bad_distance : NULL;
    gs4i_to_double(is->pivot, b->at);
    b->turn[0] = 1;
    gs4i_collider_orient(b);
    return is->shape.kind == GS4_SHAPE_MESH
               ? gs4i_field_create(&sim->error, &sim->memory, b, &sim->grid, spacing)
               : GS4_OK;
}

/* About how many points of a lattice are in its shape: of 32^3 spread over it; or all, if they are
 * no more than `few`. */
static double gs4i_estimate_points(const gs4i_lattice *l, double few)
{
    double at[3], inside = 0, all = 1;
    int i, a;
    for (a = 0; a < 3; a++) all *= (double)(l->to[a] - l->from[a]);
    if (all <= few) return all;
    for (i = 0; i < 32 * 32 * 32; i++) {
        for (a = 0; a < 3; a++)
            at[a] = l->low[a]
                    + ((double)l->from[a]
                       + ((i >> 5 * a & 31) + 0.5) / 32 * (double)(l->to[a] - l->from[a]))
                          * (double)l->fill->spacing;
        inside += gs4i_is_inside(l->shape, at);
    }
    return all * inside / (32 * 32 * 32);
}

/* All points of a filling, checked for overlap, into a list that the caller frees. How many, or
 * an error. */
static int64_t gs4i_collect_points(gs4_sim *sim, const gs4i_lattice *l, gs4_real **points)
{
    const int64_t room = (sim->desc.max_particles ? sim->desc.max_particles : GS4I_MAX_PARTICLES)
                         - sim->particles.count;
    gs4i_lattice at = *l;
    gs4_real x[3];
    int64_t n = 0, i;
    int overlap;
    const double most = 1.2 * (double)room + 1e6, about = gs4i_estimate_points(l, most);
    sim->bad_distance = 0;
    if (about > most) /* counting takes seconds for each 1e8 */
        return gs4i_fail_value(&sim->error, GS4_ERROR_MEMORY, "shape holds about ", about,
                               " particles, more than there is room for (max_particles); a larger "
                               "spacing would do; nothing was added");
    while (n <= room && gs4i_next_filled(&sim->grid, &at, x)) n++;
    GS4I_TRY(gs4i_check_distances(sim));
    if (n > room)
        return gs4i_fail(&sim->error, GS4_ERROR_MEMORY,
                         "shape holds more particles than there is room for (max_particles); a "
                         "larger spacing would do; nothing was added");
    if (n == 0)
        return gs4i_fail(&sim->error, GS4_ERROR_ARGUMENT,
                         "shape holds no particle: it is thinner than fill.spacing, outside of the "
                         "grid, or inside out");
    *points = (gs4_real *)gs4i_alloc(&sim->memory, (size_t)n, 3 * sizeof **points);
    if (!*points) return gs4i_fail_memory(&sim->error);
    for (at = *l, i = 0; i < n; i++) gs4i_next_filled(&sim->grid, &at, *points + 3 * i);
    overlap = gs4i_overlaps(sim, l, *points, (int)n);
    if (!overlap) gs4i_warn_of_bodies(sim, *points, 3, n);
    if (!overlap) return n;
    gs4i_free(&sim->memory, *points, (size_t)n, 3 * sizeof **points);
    return overlap < 0
               ? gs4i_fail_memory(&sim->error)
               : gs4i_fail(&sim->error, GS4_ERROR_ARGUMENT,
                           "shape overlaps material that is there already: nothing was added");
}

/* Particles in a shape. How many, or an error. */
static int gs4i_fill_shape(gs4_sim *sim, const gs4_shape *shape, const gs4_fill *f)
{
    const gs4_real mass = gs4i_mass_of(sim, f);
    gs4_vec3 low = shape->a, high = shape->a, centre;
    gs4_collider described;
    gs4i_collider placed;
    gs4i_lattice l;
    gs4_real *points = NULL;
    int64_t n;
    gs4i_shape_bounds(shape, &low, &high);
    centre = gs4i_scale(gs4i_add(low, high), GS4I_C(0.5));
    memset(&described, 0, sizeof described);
    described.shape = *shape;
    memset(&placed, 0, sizeof placed);
    placed.is = described;
    if (!gs4i_fill_lattice(&sim->grid, &placed, f, &l))
        return gs4i_fail(&sim->error, GS4_ERROR_ARGUMENT,
                         "shape lies outside of the grid: nothing was added");
    if ((double)(l.to[0] - l.from[0]) * (double)(l.to[1] - l.from[1])
            * (double)(l.to[2] - l.from[2])
        > 16e9)
        return gs4i_fail(
            &sim->error, GS4_ERROR_MEMORY,
            "shape spans more than 1.6e10 particles; a larger spacing would do; nothing was added");
    GS4I_TRY(gs4i_make_collider(sim, &placed, &described, (double)f->spacing));
    n = gs4i_collect_points(sim, &l, &points);
    gs4i_field_free(&sim->memory, &placed.field);
    if (n > 0) {
        const int added = gs4i_add_points(sim, points, n, mass, centre, f);
        gs4i_free(&sim->memory, points, (size_t)n, 3 * sizeof *points);
        n = added;
    }
    return (int)n;
}

/* --- colliders and emitters ------------------------------------------------------------------- */

/* A body that is not counted yet: its id, or an error. */
static int gs4i_begin_collider(gs4_sim *sim, const gs4_collider *c, double spacing)
{
    gs4i_boundary *b = &sim->boundary;
    gs4i_collider *colliders = (gs4i_collider *)gs4i_grow(
        &sim->memory, b->colliders, b->collider_count, &b->collider_capacity, sizeof *colliders);
    if (!colliders) return gs4i_fail_memory(&sim->error);
    b->colliders = colliders;
    GS4I_TRY(gs4i_make_collider(sim, &colliders[b->collider_count], c, spacing));
    return b->collider_count;
}

static int gs4i_end_collider(gs4_sim *sim)
{
    gs4i_boundary *b = &sim->boundary;
    gs4i_note_speed(sim, gs4i_collider_speed(&b->colliders[b->collider_count], &sim->grid));
    sim->limits_stale = 1;
    return b->collider_count++;
}

static int gs4i_add_collider(gs4_sim *sim, const gs4_collider *c, double spacing)
{
    const int id = gs4i_begin_collider(sim, c, spacing);
    return id < 0 ? id : gs4i_end_collider(sim);
}

/* --- emitters --------------------------------------------------------------------------------- */

enum {
    GS4I_EMITTER_LINES = 64,      /* a side, by which the area of an emitter is found to 1 % */
    GS4I_EMITTER_ROWS = 1 << 16,  /* more are not counted: so many have their area to 1 % */
    GS4I_EMITTER_PLACES = 1 << 30 /* along each axis */
};

/* Axis 0 along the flow, axis 1 in the plane of it and the direction that it has least of. */
static void gs4i_emitter_axes(gs4_vec3 flow, double axis[3][3])
{
    double f[3], length = 0, along = 0;
    int a, least = 0;
    memset(axis, 0, 9 * sizeof **axis);
    gs4i_to_double(flow, f);
    for (a = 0; a < 3; a++) {
        axis[a][a] = 1;
        length = fmax(length, fabs(f[a]));
    }
    if (!(length > 0)) return;
    for (a = 0; a < 3; a++) f[a] /= length; /* no square of it underflows */
    length = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    for (a = 0; a < 3; a++) {
        axis[0][a] = f[a] / length;
        if (fabs(f[a]) < fabs(f[least])) least = a;
    }
    for (a = 0; a < 3; a++) {
        axis[1][a] = (a == least) - axis[0][least] * axis[0][a];
        along += axis[1][a] * axis[1][a];
    }
    for (a = 0; a < 3; a++) axis[1][a] /= sqrt(along);
    for (a = 0; a < 3; a++)
        axis[2][a] = axis[0][(a + 1) % 3] * axis[1][(a + 2) % 3]
                     - axis[0][(a + 2) % 3] * axis[1][(a + 1) % 3];
}

/* Point of the shape with coordinates c along the axes. */
static void gs4i_emitter_point(const gs4i_emitter *e, const double c[3], double at[3])
{
    int a;
    for (a = 0; a < 3; a++)
        at[a] = c[0] * e->axis[0][a] + c[1] * e->axis[1][a] + c[2] * e->axis[2][a];
}

/* Does the line along the flow, at c[1] and c[2] across it, meet the shape between low and high?
 * It goes by the distance, and by 1/64 of the way at least. */
static int gs4i_line_meets(const gs4i_emitter *e, const gs4i_collider *shape, double c[3],
                           double low, double high)
{
    double at[3];
    for (c[0] = low; c[0] < high;) {
        double d;
        gs4i_emitter_point(e, c, at);
        d = (double)gs4i_shape_or_field(shape,
                                        gs4i_vec3(GS4I_C(at[0]), GS4I_C(at[1]), GS4I_C(at[2])));
        if (d < 0) return 1;
        c[0] += fmax((high - low) / (double)GS4I_EMITTER_LINES, d);
    }
    return 0;
}

/* Lines through the box low..high: the area (m^2) of those that meet the shape. Shrinks the box
 * to them and `margin` lines more across the flow, and to where the first of them does. */
static double gs4i_emitter_area(const gs4i_emitter *e, const gs4i_collider *shape, int margin,
                                double low[3], double high[3])
{
    const double step[3] = { 0, (high[1] - low[1]) / (double)GS4I_EMITTER_LINES,
                             (high[2] - low[2]) / (double)GS4I_EMITTER_LINES };
    int first[3] = { 0, GS4I_EMITTER_LINES, GS4I_EMITTER_LINES }, last[3] = { 0, -1, -1 }, n[3], a;
    double c[3], met = 0, inlet = high[0];
    for (n[1] = 0; n[1] < GS4I_EMITTER_LINES; n[1]++)
        for (n[2] = 0; n[2] < GS4I_EMITTER_LINES; n[2]++) {
            for (a = 1; a < 3; a++) c[a] = low[a] + (n[a] + 0.5) * step[a];
            if (!gs4i_line_meets(e, shape, c, low[0], high[0])) continue;
            met++;
            inlet = fmin(inlet, c[0] - (high[0] - low[0]) / (double)GS4I_EMITTER_LINES);
            for (a = 1; a < 3; a++) {
                if (n[a] < first[a]) first[a] = n[a];
                if (n[a] > last[a]) last[a] = n[a];
            }
        }
    for (a = 1; a < 3 && met > 0; a++) {
        high[a] = fmin(high[a], low[a] + (last[a] + 1 + margin) * step[a]);
        low[a] = fmax(low[a], low[a] + (first[a] - margin) * step[a]);
    }
    low[0] = fmax(low[0], inlet);
    return met * step[1] * step[2];
}

/* Rows in the box low..high, by about fill.spacing or a `finer` part of that. How many of them
 * meet the shape, whose area is given; -1: too many. */
static double gs4i_count_rows(gs4i_emitter *e, const gs4i_collider *shape, const double low[3],
                              const double high[3], double area, int finer)
{
    double c[3], rows = 0;
    int a, i, j;
    for (a = 1; a < 3; a++) {
        const double n =
            finer * fmax(1, floor((high[a] - low[a]) / (double)e->is.fill.spacing + 0.5));
        if (!(n <= (double)GS4I_EMITTER_PLACES)) return -1;
        e->places[a] = (int)n;
        e->spacing[a] = (high[a] - low[a]) / n;
        e->low[a] = low[a];
    }
    if ((double)e->places[1] * e->places[2] > (double)GS4I_EMITTER_ROWS)
        return area / (e->spacing[1] * e->spacing[2]);
    for (i = 0; i < e->places[1]; i++)
        for (j = 0; j < e->places[2]; j++) {
            c[1] = low[1] + (i + 0.5) * e->spacing[1];
            c[2] = low[2] + (j + 0.5) * e->spacing[2];
            rows += gs4i_line_meets(e, shape, c, low[0], high[0]);
        }
    return rows;
}

/* Rows between low and high, each of which stands for `area`: particles have their usual mass, and
 * the spacing along rows makes up for what rows do not fill. Where that would be far from what
 * fill.spacing says, as in an emitter of a cell or less, it is their mass that does. */
static int gs4i_space_rows(gs4_sim *sim, gs4i_emitter *e, double area, double low, double high)
{
    const double density = (double)sim->constants[e->is.fill.material].density,
                 usual = (double)e->is.fill.spacing;
    double spacing = usual * usual * usual / area, volume = usual * usual * usual;
    if (!(spacing > 0.7 * usual && spacing < 1.4 * usual)) {
        spacing = fmin(usual, fmin(e->spacing[1], e->spacing[2]));
        volume = area * spacing;
    }
    e->mass = GS4I_C(density * volume);
    e->low[0] = low;
    e->spacing[0] = spacing;
    e->window = fmin(high - low, spacing);
    GS4I_TRY(gs4i_require(&sim->error,
                          area > 0 && (high - low) / spacing < (double)GS4I_EMITTER_PLACES,
                          "shape is more than 2^30 particles wide"));
    e->places[0] = (int)ceil((high - low) / spacing);
    return gs4i_require(&sim->error, e->window > 0.01 * spacing,
                        "shape is thinner along the flow than a hundredth of fill.spacing");
}

/* The box around the shape, along the axes of the emitter; of a shape that is far larger than the
 * domain, what is within 2^20 cells of that. */
static void gs4i_emitter_bounds(const gs4i_emitter *e, const gs4i_grid *g, double low[3],
                                double high[3])
{
    const double reach = (double)g->h * (1 << 20);
    double from[3], to[3], origin[3];
    gs4_vec3 a, b;
    int k, i;
    gs4i_shape_bounds(&e->is.shape, &a, &b);
    gs4i_to_double(a, from);
    gs4i_to_double(b, to);
    gs4i_to_double(g->origin, origin);
    for (k = 0; k < 3; k++) {
        from[k] = fmax(from[k], origin[k] - reach);
        to[k] = fmin(to[k], origin[k] + g->cells[k] * (double)g->h + reach);
    }
    for (k = 0; k < 3; k++) {
        double middle = 0, half = 0;
        for (i = 0; i < 3; i++) {
            middle += e->axis[k][i] * 0.5 * (from[i] + to[i]);
            half += fabs(e->axis[k][i]) * 0.5 * (to[i] - from[i]);
        }
        low[k] = middle - half;
        high[k] = middle + half;
    }
}

/* Axes and rows of an emitter, and the mass of its particles. */
static int gs4i_lay_rows(gs4_sim *sim, gs4i_emitter *e)
{
    const gs4i_collider *shape = &sim->boundary.colliders[e->collider];
    double low[3], high[3], area = 0, rows;
    int finer, margin;
    gs4i_emitter_axes(e->is.fill.velocity, e->axis);
    gs4i_emitter_bounds(e, &sim->grid, low, high);
    sim->bad_distance = 0;
    /* once more in what is left of the box, for the area itself */
    for (margin = 1; margin >= 0; margin--) area = gs4i_emitter_area(e, shape, margin, low, high);
    GS4I_TRY(gs4i_check_distances(sim));
    GS4I_TRY(gs4i_require(&sim->error, area > 0,
                          "shape: no line along the flow meets it; it is inside out, or thinner "
                          "than a hundredth of the box around it"));
    for (finer = 1, rows = 0; finer <= 16 && rows == 0; finer *= 2)
        rows = gs4i_count_rows(e, shape, low, high, area, finer);
    GS4I_TRY(gs4i_require(&sim->error, rows != 0, "shape is too thin to hold a row of particles"));
    return gs4i_space_rows(sim, e, area / rows, low[0], high[0]);
}

/* What an emitter is likely not meant to be. */
static void gs4i_warn_of_emitter(gs4_sim *sim, const gs4_emitter *e)
{
    const gs4_vec3 flow = e->fill.velocity;
    gs4_vec3 low = e->shape.a, high = e->shape.b, size;
    gs4i_shape_bounds(&e->shape, &low, &high);
    size = gs4i_sub(high, low);
    if (gs4i_min(size.x, gs4i_min(size.y, size.z)) < e->fill.spacing)
        gs4i_warn(sim, GS4I_WARN_THIN_EMITTER,
                  "an emitter is thinner than fill.spacing: its particles are lighter than others");
    if (flow.x == 0 && flow.y == 0 && flow.z == 0)
        gs4i_warn(sim, GS4I_WARN_STILL_EMITTER,
                  "an emitter has no fill.velocity, which is relative to it: it is filled once "
                  "and then gives nothing");
    gs4i_warn_of_filling(sim, &e->shape, &e->fill);
    if (sim->warned & GS4I_WARN_CUT_OFF) sim->warned |= GS4I_WARN_EMITTER_OUTSIDE; /* is said */
}

/* An emitter is a collider too, which holds what is inside at the velocity of its flow. */
static int gs4i_add_emitter(gs4_sim *sim, const gs4_emitter *is)
{
    gs4_collider held;
    gs4i_emitter *emitters, *e;
    int id, result;
    memset(&held, 0, sizeof held);
    held.shape = is->shape;
    held.velocity = is->travel;
    held.pivot = is->pivot;
    held.temperature = is->fill.temperature;
    emitters = (gs4i_emitter *)gs4i_grow(&sim->memory, sim->emitters, sim->emitter_count,
                                         &sim->emitter_capacity, sizeof *emitters);
    if (!emitters) return gs4i_fail_memory(&sim->error);
    sim->emitters = emitters;
    id = gs4i_begin_collider(sim, &held, (double)is->fill.spacing);
    if (id < 0) return id;
    e = &sim->emitters[sim->emitter_count];
    memset(e, 0, sizeof *e);
    e->is = *is;
    e->collider = id;
    result = gs4i_lay_rows(sim, e);
    if (result < 0) {
        gs4i_field_free(&sim->memory, &sim->boundary.colliders[id].field);
        return result;
    }
    gs4i_end_collider(sim);
    sim->boundary.colliders[id].is_emitter = 1;
    sim->boundary.colliders[id].is_off = 1;
    sim->boundary.colliders[id].flow = is->fill.velocity;
    gs4i_note_speed(sim, gs4i_length(is->fill.velocity) + gs4i_length(is->travel));
    gs4i_warn_of_emitter(sim, is);
    return sim->emitter_count++;
}

static int gs4i_emitter_is_on(const gs4i_emitter *e, double time)
{
    return time >= (double)e->is.start && (e->is.stop <= 0 || time < (double)e->is.stop);
}

/* For how long of the time from `from` on, dt long, it is on, s. */
static double gs4i_emitter_active(const gs4i_emitter *e, double from, double dt)
{
    const double stop = e->is.stop > 0 ? fmin(from + dt, (double)e->is.stop) : from + dt;
    return fmax(0, stop - fmax(from, (double)e->is.start));
}

/* Emission is due when material has flowed by a twentieth of its spacing, or for the first time. */
static int gs4i_emission_is_due(const gs4i_emitter *e, double flowed)
{
    return e->active > 0 && (!e->has_emitted || flowed - e->emitted > 0.05 * e->spacing[0]);
}

/* How far material has flowed when this step ends, m. */
static double gs4i_flowed_after(const gs4i_emitter *e)
{
    return e->flowed + (double)gs4i_length(e->is.fill.velocity) * e->active;
}

/* The body of an emitter in a time dt: it moves from its start on. */
static void gs4i_move_emitter(const gs4i_emitter *e, gs4i_collider *body, double time, double dt)
{
    const double since = time + dt - (double)e->is.start;
    if (since > 0) gs4i_collider_move(body, fmin(dt, since));
}

static void gs4i_move_bodies(gs4_sim *sim, double dt)
{
    int i;
    for (i = 0; i < sim->boundary.collider_count; i++)
        if (!sim->boundary.colliders[i].is_emitter)
            gs4i_collider_move(&sim->boundary.colliders[i], dt);
    for (i = 0; i < sim->emitter_count; i++) {
        const gs4i_emitter *e = &sim->emitters[i];
        gs4i_move_emitter(e, &sim->boundary.colliders[e->collider], sim->time, dt);
    }
}

/* The places of an emitter, one after the other: those that are in it when material has flowed by
 * `to` and were not when it had by `from`, less than what a row has room for before. So until all
 * has flowed by `flowed`. */
typedef struct gs4i_emission {
    const gs4i_emitter *e;
    const gs4i_collider *body;
    double from, to, flowed;
    int is_first;             /* `from` is none */
    double low[3], high[3];   /* the domain, along the axes of the emitter */
    int64_t first[3], end[3]; /* first <= n < end */
    int64_t n[3];
} gs4i_emission;

/* The box along the axes of the emitter that the domain is in. */
static void gs4i_see_domain(gs4i_emission *q, const gs4i_grid *g)
{
    const gs4_real size[3] = { GS4I_C(g->cells[0]) * g->h, GS4I_C(g->cells[1]) * g->h,
                               GS4I_C(g->cells[2]) * g->h };
    int corner, k;
    for (corner = 0; corner < 8; corner++) {
        const gs4_vec3 at =
            gs4i_add(g->origin, gs4i_vec3(corner & 1 ? size[0] : 0, corner & 2 ? size[1] : 0,
                                          corner & 4 ? size[2] : 0));
        double p[3];
        gs4i_to_double(gs4i_to_collider(q->body, at), p);
        for (k = 0; k < 3; k++) {
            const double *axis = q->e->axis[k];
            const double c = p[0] * axis[0] + p[1] * axis[1] + p[2] * axis[2];
            q->low[k] = corner ? fmin(q->low[k], c) : c;
            q->high[k] = corner ? fmax(q->high[k], c) : c;
        }
    }
}

/* Places that may come in now, as far as they are in the domain. */
static void gs4i_begin_places(gs4i_emission *q)
{
    const gs4i_emitter *e = q->e;
    int k;
    for (k = 0; k < 3; k++) {
        const double flowed = k ? 0 : q->to, margin = k ? 0 : 1 + ceil(flowed / e->spacing[0]),
                     begin = floor((q->low[k] - e->low[k] - flowed) / e->spacing[k]) - 1,
                     end = ceil((q->high[k] - e->low[k] - flowed) / e->spacing[k]) + 1;
        q->first[k] = (int64_t)fmin(fmax(begin, -margin), e->places[k]);
        q->end[k] =
            (int64_t)fmax(fmin(end, e->places[k] + (k ? 0 : 3 - margin)), (double)q->first[k]);
        q->n[k] = q->first[k];
    }
    q->n[0]--;
    if (q->end[0] == q->first[0] || q->end[1] == q->first[1]) q->end[2] = q->first[2];
}

static void gs4i_flow_on(gs4i_emission *q)
{
    q->from = q->to;
    q->to = fmin(q->flowed, q->to + 0.25 * q->e->window);
}

static gs4i_emission gs4i_begin_emission(const gs4i_grid *g, const gs4i_emitter *e,
                                         const gs4i_collider *body, double flowed)
{
    gs4i_emission q;
    q.e = e;
    q.body = body;
    q.flowed = flowed;
    q.to = q.from = e->emitted;
    q.is_first = !e->has_emitted;
    gs4i_see_domain(&q, g);
    if (!q.is_first) gs4i_flow_on(&q);
    gs4i_begin_places(&q);
    return q;
}

/* To the next place; 0 behind the last one. */
static int gs4i_next_place(gs4i_emission *q)
{
    for (;;) {
        if (q->end[2] > q->first[2]) {
            if (++q->n[0] < q->end[0]) return 1;
            q->n[0] = q->first[0];
            if (++q->n[1] < q->end[1]) return 1;
            q->n[1] = q->first[1];
            if (++q->n[2] < q->end[2]) return 1;
        }
        if (!(q->to < q->flowed)) return 0;
        gs4i_flow_on(q);
        q->is_first = 0;
        gs4i_begin_places(q);
    }
}

/* How far ahead a row is, in spacings from -1/2 to 1/2, so that not all rows give at once. Mirror
 * images of a row go with it; the factors are powers of the plastic number's reciprocal. */
static double gs4i_row_phase(const gs4i_emitter *e, const int64_t n[3])
{
    /* rings around the middle */
    const double u = floor(fabs((double)(2 * n[1] + 1 - e->places[1])) / 2),
                 v = floor(fabs((double)(2 * n[2] + 1 - e->places[2])) / 2);
    const double t = 0.5 + 0.75487766624669276 * fmin(u, v) + 0.56984029099805327 * fmax(u, v);
    return t - floor(t) - 0.5;
}

/* World point x of the next place that comes into the emitter; 0: there is none. Jitter does not
 * take it out of there. */
static int gs4i_next_emitted(gs4i_emission *q, gs4_real x[3])
{
    const gs4i_emitter *e = q->e;
    double c[3], at[3], along;
    int a, k;
    while (gs4i_next_place(q)) {
        for (a = 0; a < 3; a++) c[a] = e->low[a] + ((double)q->n[a] + 0.5) * e->spacing[a];
        along = c[0] + gs4i_row_phase(e, q->n) * e->spacing[0];
        c[0] = along + q->from;
        gs4i_emitter_point(e, c, at);
        if (!q->is_first && gs4i_is_inside(q->body, at)) continue;
        c[0] = along + q->to;
        gs4i_emitter_point(e, c, at);
        if (!gs4i_is_inside(q->body, at)) continue;
        for (k = e->is.fill.jitter > 0; k >= 0; k--) {
            double d[3];
            for (a = 0; a < 3; a++)
                d[a] = c[a]
                       + k * (double)(e->is.fill.jitter * gs4i_lattice_noise(&e->is.fill, q->n, a))
                             * e->spacing[a];
            gs4i_emitter_point(e, d, at);
            if (gs4i_is_inside(q->body, at)) break;
        }
        for (a = 0; a < 3; a++) at[a] += (q->flowed - q->to) * e->axis[0][a];
        gs4i_from_collider(q->body, at, x);
        return 1;
    }
    return 0;
}

/* Is there room for all places of an emitter in the domain? */
static int gs4i_check_emission(gs4_sim *sim, const gs4i_emission *q)
{
    double all = 1;
    int a;
    for (a = 0; a < 3; a++) all *= (double)(q->end[a] - q->first[a]);
    if (!(all > 2.0 * GS4I_MAX_PARTICLES)) return GS4_OK;
    return gs4i_fail_value(&sim->error, GS4_ERROR_MEMORY, "an emitter holds about ", all,
                           " particles; there may be 1073741808; a larger fill.spacing or "
                           "max_particles would do");
}

/* At the begin of a step: which emitters hold their nodes, and room for what they will give in
 * it, so that emitting cannot fail afterwards. */
static int gs4i_prepare_emitters(gs4_sim *sim, double dt)
{
    int i, n = 0, wanted;
    for (i = 0; i < sim->emitter_count; i++) {
        gs4i_emitter *e = &sim->emitters[i];
        gs4i_emission q;
        gs4_real x[3];
        gs4i_collider then = sim->boundary.colliders[e->collider];
        double flowed;
        e->active = gs4i_emitter_active(e, sim->time, dt);
        flowed = gs4i_flowed_after(e);
        sim->boundary.colliders[e->collider].is_off = !gs4i_emitter_is_on(e, sim->time);
        if (!gs4i_emission_is_due(e, flowed)) continue;
        /* with max_particles there is all the room there will be; emitters pause when it is full */
        if (sim->desc.max_particles) continue;
        gs4i_move_emitter(e, &then, sim->time, dt);
        q = gs4i_begin_emission(&sim->grid, e, &then, flowed);
        GS4I_TRY(gs4i_check_emission(sim, &q));
        while (gs4i_next_emitted(&q, x)) n++;
    }
    if (n == 0) return GS4_OK;
    wanted = sim->particles.count + n;
    if (wanted <= sim->particles.capacity) return GS4_OK;
    if (wanted > GS4I_MAX_PARTICLES)
        return gs4i_fail(&sim->error, GS4_ERROR_MEMORY, "more than 1073741808 particles");
    wanted += wanted / 8;
    if (gs4i_particles_reserve(&sim->memory, &sim->particles, wanted) != GS4_OK)
        return gs4i_fail_memory(&sim->error);
    return GS4_OK;
}

/* What is new counts for the next limit. */
static void gs4i_note_emission(gs4_sim *sim, const gs4i_material_constants *m)
{
    gs4i_report *r = &sim->limits;
    r->max_sound = gs4i_max(r->max_sound, m->sound_speed * GS4I_SQRT(m->lone));
    r->max_viscosity = gs4i_max(r->max_viscosity, m->viscosity * m->inv_density);
    r->max_stiffness =
        gs4i_max(r->max_stiffness, gs4i_max(2 * m->modulus, GS4I_SOLID_WAVES * m->shear_modulus)
                                       * m->lone * m->inv_density);
    if (m->varies) sim->limits_stale = 1;
}

/* New particles of emitter i. */
static void gs4i_emit_rows(gs4_sim *sim, int i, double flowed)
{
    const gs4i_emitter *e = &sim->emitters[i];
    const gs4i_collider *body = &sim->boundary.colliders[e->collider];
    gs4i_emission q = gs4i_begin_emission(&sim->grid, e, body, flowed);
    gs4_real x[3];
    while (gs4i_next_emitted(&q, x)) {
        const gs4_vec3 at = gs4i_vec3(x[0], x[1], x[2]);
        if (!gs4i_is_in_domain(&sim->grid, x)) {
            gs4i_warn(sim, GS4I_WARN_EMITTER_OUTSIDE,
                      "an emitter is out of the domain, in part at least: that gives nothing");
            continue;
        }
        if (gs4i_will_warn(sim, GS4I_WARN_EMITTER_IN_BODY) && gs4i_is_in_body(sim, x))
            gs4i_warn(sim, GS4I_WARN_EMITTER_IN_BODY,
                      "a collider covers an emitter, in part at least: what it gives has to "
                      "get out of there");
        if (!gs4i_add_particle(sim, at, gs4i_collider_velocity(body, at), e->mass, &e->is.fill)) {
            gs4i_warn(sim, GS4I_WARN_FULL, "an emitter pauses: max_particles is reached");
            break;
        }
    }
}

/* At the end of a step: new particles where rows have flowed into their emitters. */
static void gs4i_emit(gs4_sim *sim)
{
    int i;
    for (i = 0; i < sim->emitter_count; i++) {
        gs4i_emitter *e = &sim->emitters[i];
        e->flowed = gs4i_flowed_after(e);
        if (!gs4i_emission_is_due(e, e->flowed)) continue;
        gs4i_emit_rows(sim, i, e->flowed);
        e->emitted = e->flowed;
        e->has_emitted = 1;
        gs4i_note_emission(sim, &sim->constants[e->is.fill.material]);
    }
}

/* Particles inside the shape are dropped; with NULL, those that went out through an open wall. The
 * others close up in order. */
static void gs4i_drop(gs4_sim *sim, const gs4i_collider *shape)
{
    gs4i_particles *p = &sim->particles;
    gs4i_array a[GS4I_ARRAYS];
    size_t i, kept = 0;
    int k;
    gs4i_particle_arrays(p, a);
    for (i = 0; i < (size_t)p->count; i++) {
        const gs4_real *x = p->position + 4 * i;
        if (shape ? gs4i_collider_distance(shape, gs4i_vec3(x[0], x[1], x[2])) < 0
                  : !gs4i_is_in_domain(&sim->grid, x))
            continue;
        for (k = 0; k < GS4I_ARRAYS && kept != i; k++)
            if (*a[k].data)
                memcpy((char *)*a[k].data + kept * a[k].size, (char *)*a[k].data + i * a[k].size,
                       a[k].size);
        kept++;
    }
    p->count = (int)kept;
    sim->needs_sort = 1;
}

/* Particles in a shape go. How many, or an error. */
static int gs4i_empty_shape(gs4_sim *sim, const gs4_shape *shape)
{
    const int before = sim->particles.count;
    gs4_collider described;
    gs4i_collider placed;
    int i, result;
    memset(&described, 0, sizeof described);
    described.shape = *shape;
    GS4I_TRY(gs4i_make_collider(sim, &placed, &described, 0.5 * (double)sim->grid.h));
    sim->bad_distance = 0;
    for (i = 0; i < before; i++) { /* asks for all distances before anything goes */
        const gs4_real *x = sim->particles.position + 4 * (size_t)i;
        (void)gs4i_collider_distance(&placed, gs4i_vec3(x[0], x[1], x[2]));
    }
    result = gs4i_check_distances(sim);
    if (result == GS4_OK) {
        gs4i_drop(sim, &placed);
        sim->limits_stale = 1;
        result = before - sim->particles.count;
    }
    gs4i_field_free(&sim->memory, &placed.field);
    return result;
}

/* ==== [[step]] one step; the function to read first is gs4i_step, at the end of this section == */

/* --- what can go wrong, in words -------------------------------------------------------------- */

static int gs4i_fail_bad(gs4_sim *sim, const gs4i_report *r)
{
    gs4i_text t = gs4i_begin_error(&sim->error);
    gs4i_put(&t, "particle ");
    gs4i_put_integer(&t, (int64_t)r->bad_id);
    gs4i_put(
        &t, r->bad == GS4I_BAD_VOLUME ? " would leave the range of volume ratios 1/16 to 256"
            : r->bad == GS4I_BAD_MOTION
                ? " would move more than two cells, or its state would not be finite"
            : r->bad == GS4I_BAD_STRESS
                ? " has a non-local stress that overflows, or swings faster than it can be followed"
            : r->bad == GS4I_BAD_DEFORMATION
                ? " would be stretched, sheared or turned by more than a factor of e^8 in one step"
                : " has a viscosity that is negative, not finite or absurdly large");
    gs4i_put(&t, "; the step was not taken; ");
    gs4i_put(&t, r->bad == GS4I_BAD_VISCOSITY
                     ? "the viscosity's law must give 0 or a finite number above"
                     : "a smaller dt, a higher sound_speed or a slower start would do");
    return gs4i_end_error(&sim->error, GS4_ERROR_UNSTABLE);
}

/* --- stability -------------------------------------------------------------------------------- */

/* What melts or freezes may do so in the next step: both its phases count. */
static gs4i_report gs4i_with_both_phases(const gs4_sim *sim, gs4i_report r)
{
    gs4i_gradient none;
    int i;
    memset(none, 0, sizeof none);
    for (i = 0; i < sim->material_count && sim->particles.count; i++) {
        const gs4i_material_constants *l = &sim->constants[i], *solid = &sim->solid_phase[i];
        gs4_real mu;
        if (!l->is.can_melt) continue;
        mu = l->local * gs4i_viscosity_of(l, l->melting, none, 0);
        r.max_stiffness = gs4i_max(r.max_stiffness,
                                   gs4i_max(GS4I_SOLID_WAVES * solid->shear_modulus, 2 * l->modulus)
                                       * l->lone * l->inv_density);
        if (mu < GS4I_HUGE) r.max_viscosity = gs4i_max(r.max_viscosity, mu * l->inv_density);
    }
    return r;
}

/* Largest stable dt: what the scheme allows for waves and viscosity; one cell a step, the fall
 * within it included; a velocity gradient that turns or stretches by less than 1; and 1000
 * relaxation times, so that no particle needs more substeps than there may be. */
static gs4_real gs4i_stable_dt(const gs4_sim *sim, const gs4i_report *seen)
{
    const gs4i_report r = gs4i_with_both_phases(sim, *seen);
    const double h = (double)sim->grid.h, speed = (double)r.max_speed,
                 gradient = (double)r.max_gradient;
    const double fall =
        (double)gs4i_max(gs4i_abs(sim->desc.gravity.x),
                         gs4i_max(gs4i_abs(sim->desc.gravity.y), gs4i_abs(sim->desc.gravity.z)));
    /* of sound and of elasticity */
    const double wave = sqrt((double)r.max_sound * (double)r.max_sound + (double)r.max_stiffness);
    double dt = gs4i_scheme_of(sim)->stable_dt(sim, wave, (double)r.max_viscosity);
    int i;
    if (speed * dt + 0.5 * fall * dt * dt > h)
        dt = 2 * h / (speed + sqrt(speed * speed + 2 * fall * h));
    if (gradient * dt > 1) dt = 1 / gradient;
    for (i = 0; i < sim->material_count; i++)
        if ((double)sim->constants[i].inv_lambda * dt > 1000)
            dt = 1000 / (double)sim->constants[i].inv_lambda;
    if (dt > (double)GS4I_HUGE) dt = (double)GS4I_HUGE;
    return GS4I_C(dt);
}

/* Speeds that colliders and emitters will give to their nodes, and velocity gradients: |grad v|
 * of a body that turns is sqrt(2) |w|. */
static void gs4i_see_colliders(const gs4_sim *sim, gs4i_report *r)
{
    int i;
    for (i = 0; i < sim->boundary.collider_count; i++) {
        const gs4i_collider *c = &sim->boundary.colliders[i];
        r->max_speed =
            gs4i_max(r->max_speed, gs4i_collider_speed(c, &sim->grid) + gs4i_length(c->flow));
        r->max_gradient =
            gs4i_max(r->max_gradient, GS4I_SQRT(GS4I_C(2)) * gs4i_length(c->is.angular_velocity));
    }
}

/* Sound speeds of a batch, where the greatest speed has become `top_speed`. */
static void gs4i_follow_speed(const gs4_sim *sim, gs4_real top_speed, gs4i_batch_constants *l)
{
    int b;
    for (b = 0; b < GS4I_BATCH && top_speed > sim->top_speed && sim->desc.scheme == GS4_EXPLICIT;
         b++) {
        const double c0 =
            gs4i_sound_speed_of(&sim->desc, &l->of[b]->is, top_speed, gs4i_extreme_density(sim, 1));
        GS4I_NTH(l->wave_speed, b) = GS4I_C(c0) * GS4I_SQRT(l->of[b]->lone);
        GS4I_NTH(l->tait, b) = gs4i_tait_of(&l->of[b]->is, c0);
    }
}

/* The extremes that set the limit, from the particles as they are: after the scene was changed
 * by hand, which may have brought a greater `top_speed`. */
static void gs4i_find_limits(const gs4_sim *sim, gs4_real top_speed, gs4i_report *report)
{
    const gs4i_particles *p = &sim->particles;
    const gs4i_prediction now = { 0, 0, 0 };
    gs4i_heat_work heat;
    gs4i_response r;
    int i;
    gs4i_report_clear(report);
    gs4i_begin_response(&r, sim, p, NULL, report, NULL);
    memset(&heat, 0, sizeof heat);
    if (p->with_heat) r.heat = &heat;
    for (i = 0; i < p->count; i += GS4I_BATCH) {
        const int n = gs4i_batch_size((size_t)i, (size_t)p->count);
        gs4i_batch q;
        gs4i_gradient L;
        gs4i_symmetric sigma;
        gs4i_lanes mu;
        gs4i_load_batch(p, (size_t)i, n, now, &q);
        if (!p->with_rates)
            gs4i_load_affine(p, (size_t)i, n, L);
        else
            memset(L, 0, sizeof L);
        gs4i_turn_to_batch(&r, (size_t)i, n);
        gs4i_follow_speed(sim, top_speed, &r.constants);
        if (r.heat) gs4i_load_batch_heat(&r);
        gs4i_stress(&r, L, q.v[3], sigma, mu);
        gs4i_check_liquids(report, q.v[3], mu, p->id + i, n);
        gs4i_see_motion(&r.seen, q.v, L);
    }
    gs4i_report_liquids(report, &r.seen);
    gs4i_report_motion(report, &r.seen);
    report->max_speed = GS4I_SQRT(report->max_speed);
    report->max_gradient = GS4I_SQRT(report->max_gradient);
    gs4i_see_colliders(sim, report);
}

/* The member of the family (r, s), or its first step. */
static void gs4i_family(gs4i_integrator *k, gs4_real r, gs4_real s, int restart)
{
    k->alpha_m = restart ? GS4I_C(1) : (3 + r + s - r * s) / (2 * (1 + r) * (1 + s));
    k->alpha_f = restart ? GS4I_C(0.5) : 1 / (1 + r);
    k->gamma = restart ? GS4I_C(1) : 1 / (1 + s);
}

/* Is J of all materials near nodes that they share one strain? Weighed by mass it is that of the
 * densest, and as a pressure next to nothing for it may be more than a soft one has of volume: with
 * a decay to it 100 on 1 gained 10000 times its energy, 10 on 1 gained 1e-4. */
static int gs4i_materials_are_alike(const gs4_sim *sim)
{
    const gs4i_material_constants *l = sim->constants;
    int i;
    for (i = 1; i < sim->material_count; i++) {
        const gs4_real density = l[i].density / l[0].density, stiffness = l[i].tait / l[0].tait;
        if (!(density >= GS4I_C(0.5) && density <= 2 && stiffness >= GS4I_C(0.5) && stiffness <= 2))
            return 0;
    }
    return 1;
}

/* s, chosen: in which the sub-grid velocity decays by default, noise or not. */
#define GS4I_SLOW_DECAY GS4I_C(0.5)

/* Decay of the sub-grid velocity v~ - V at the rate k = 1/flip_decay_time. In S7 it stands in the
 * rate of velocity, explicitly, and (4) is stable up to k_max = 4 (1 - r s)/((3 + r + s - r s) dt).
 * With x = k/(0.8 k_max) the rate taken is k (1 + x)/(1 + x + x^2): k for small x, 0.8 k_max for
 * large. Where k dt > 1 there is no such rate at all: a longer step after it would blow it up, and
 * with r = 1 it would not decay. Then the share s k/(1 + s k) goes at once.
 * By default noise decays as fast as it crosses cells, at |v~ - V|/h more, and in 0.5 s else, which
 * takes what rounding makes: where flow is smooth v~ - V is of second order in h, so what it loses
 * is of the third. */
static void gs4i_set_decay(gs4i_integrator *k, const gs4_sim *sim)
{
    const gs4_real r = sim->desc.rho_inf, s = sim->desc.rho_inf_spurious,
                   most = GS4I_C(3.2) * (1 - r * s) / ((3 + r + s - r * s) * k->dt);
    const int by_noise = sim->desc.flip_decay_time == 0 && sim->particles.with_rates;
    const gs4_real time = by_noise ? GS4I_SLOW_DECAY : sim->desc.flip_decay_time;
    gs4_real y;
    /* in less than 1e-6 dt makes no difference */
    k->decay = time > 0 && gs4i_finite(time) ? 1 / gs4i_max(time, GS4I_C(1e-6) * k->dt) : GS4I_C(0);
    k->decayed_at_once = 0;
    if (k->decay * k->dt > 1) {
        k->decayed_at_once = 1 - 1 / (1 + k->s * k->decay);
        k->decay = 0;
    }
    k->stopping = most / GS4I_C(1.6);
    y = most / gs4i_max(most + k->decay, GS4I_TINY); /* 1 / (1 + x) */
    k->stable_decay = k->decay * y / (1 - y + y * y);
    k->inv_stable = 1 / most;
    k->crossing = by_noise && !sim->particles.deformation_reals ? sim->grid.inv_h : GS4I_C(0);
    k->volume_crossing =
        k->crossing > 0 && !sim->grid.with_deconvolution && gs4i_materials_are_alike(sim)
            ? k->fast_decay
            : GS4I_C(0);
    k->weight_crossing = k->volume_crossing > 0
                             ? gs4i_length(sim->desc.gravity) / (k->volume_crossing * sim->grid.h)
                             : GS4I_C(0);
}

static gs4i_integrator gs4i_make_integrator(const gs4_sim *sim, gs4_real dt)
{
    const gs4_real r = sim->desc.rho_inf, s = sim->desc.rho_inf_spurious, h = sim->grid.h;
    const int with_rates = sim->particles.with_rates;
    gs4i_integrator k;
    int i;
    k.dt = dt;
    k.restart = sim->restart;
    gs4i_family(&k, r, s, 0);
    k.impact = GS4I_C(0.5);
    if (k.restart && sim->desc.integrator == GS4_INTEGRATOR_GS4)
        k.impact /= 1 + k.alpha_m - k.gamma;
    gs4i_family(&k, r, s, k.restart);
    if (sim->desc.integrator == GS4_INTEGRATOR_BACKWARD_EULER) k.alpha_m = k.alpha_f = k.gamma = 1;
    k.affine_ratio = k.restart || sim->desc.integrator != GS4_INTEGRATOR_GS4 || !(sim->last_dt > 0)
                         ? GS4I_C(0)
                         : dt / GS4I_C(sim->last_dt);
    k.prediction.ahead = with_rates ? k.alpha_f * dt : GS4I_C(0);
    k.prediction.shift = k.restart ? GS4I_C(0) : sim->shift;
    k.prediction.bend = sim->desc.scheme == GS4_PARTITIONED
                            ? GS4I_C(0.5) * k.prediction.ahead * k.prediction.ahead
                            : GS4I_C(0);
    k.next_shift = (k.gamma - GS4I_C(0.5)) * dt;
    if (!with_rates) k.alpha_m = k.alpha_f = k.gamma = 1; /* of heat: backward Euler */
    k.inv_alpha_m = 1 / k.alpha_m;
    k.s = k.alpha_f * k.gamma * dt / k.alpha_m;
    k.before = with_rates ? k.prediction.ahead - k.s : GS4I_C(0);
    k.inv_area = sim->grid.inv_h * sim->grid.inv_h;
    k.fast_decay = k.inv_node_mass = 0;
    k.inv_densest_node_mass = GS4I_HUGE;
    for (i = 0; i < sim->material_count; i++) {
        const gs4_real inverse = sim->constants[i].inv_density / (h * h * h);
        k.fast_decay = gs4i_max(k.fast_decay, sim->constants[i].sound_speed / h);
        k.inv_node_mass = gs4i_max(k.inv_node_mass, inverse);
        k.inv_densest_node_mass = gs4i_min(k.inv_densest_node_mass, inverse);
    }
    k.unpacking = !sim->particles.deformation_reals && !sim->grid.with_deconvolution
                          && k.inv_densest_node_mass >= GS4I_C(0.99) * k.inv_node_mass
                      ? GS4I_C(0.005) * k.fast_decay
                      : GS4I_C(0);
    gs4i_set_decay(&k, sim);
    return k;
}

/* k_eff dt / (rho c h^2) of the best conductor: cells^2 that heat goes in a step. */
static gs4_real gs4i_heat_number(const gs4_sim *sim, const gs4i_integrator *k)
{
    const gs4_real half = GS4I_C(0.5) * k->dt;
    gs4_real most = 0;
    int i;
    for (i = 0; i < sim->material_count; i++) {
        const gs4i_material_constants *mat = &sim->constants[i];
        const gs4_real local = (mat->fourier * mat->flux_time + half) / (mat->flux_time + half);
        if (mat->conductivity > 0)
            most = gs4i_max(most, local * (mat->conductivity / mat->capacity) * mat->inv_density
                                      * k->dt * k->inv_area);
    }
    return most;
}

/* The same for heat, which has steps far beyond its own limit: there a rate is what a step as
 * long as the last one has left to do, and where dt has grown by more than twice, rates start
 * anew. Without rates alpha_f = 1/2 would answer a wall with twice its temperature, so it goes to
 * 1, backward Euler, as heat goes further in the step. */
static gs4i_integrator gs4i_make_heat_integrator(const gs4_sim *sim)
{
    gs4i_integrator k = sim->integrator;
    const int grown = sim->last_dt > 0 && sim->last_dt / (double)k.dt < 0.5;
    if (!sim->particles.with_rates || !(k.restart || grown)) return k;
    if (!k.restart) k.prediction.ahead = k.before = 0;
    gs4i_family(&k, 0, 0, 1);
    k.alpha_f = gs4i_max(k.alpha_f, 1 - 1 / gs4i_max(gs4i_heat_number(sim, &k), GS4I_C(1)));
    k.s = k.alpha_f * k.gamma * k.dt / k.alpha_m;
    k.inv_alpha_m = 1 / k.alpha_m;
    return k;
}

/* --- stages ----------------------------------------------------------------------------------- */

/* Everything whose size follows the blocks. */
static int gs4i_after_occupy(gs4_sim *sim)
{
    gs4i_memory *m = &sim->memory;
    if (gs4i_list_mirror_nodes(m, &sim->boundary, &sim->grid) != GS4_OK)
        return gs4i_fail_memory(&sim->error);
    if (sim->grid.occupied_capacity > sim->report_capacity) {
        gs4i_report *r =
            (gs4i_report *)gs4i_alloc(m, (size_t)sim->grid.occupied_capacity, sizeof *r);
        if (!r) return gs4i_fail_memory(&sim->error);
        gs4i_free(m, sim->reports, (size_t)sim->report_capacity, sizeof *r);
        sim->reports = r;
        sim->report_capacity = sim->grid.occupied_capacity;
    }
    return gs4i_reserve_conduction(sim) == GS4_OK ? GS4_OK : gs4i_fail_memory(&sim->error);
}

/* S1: sort. */
static int gs4i_bin(gs4_sim *sim)
{
    const double start = gs4i_now(sim);
    if (gs4i_particles_sort(&sim->memory, &sim->tasks, &sim->particles, &sim->grid,
                            sim->integrator.prediction)
        != GS4_OK)
        return gs4i_fail_memory(&sim->error);
    sim->needs_sort = 1;
    GS4I_TRY(gs4i_after_occupy(sim));
    sim->needs_sort = 0;
    sim->seconds[GS4I_CLOCK_SORT] += gs4i_since(sim, start);
    return GS4_OK;
}

/* S1 to S3 as far as sums: scatter; when particles have left the tile of their block, sort and
 * scatter again. */
static int gs4i_rasterise(gs4_sim *sim, gs4i_node_pass *nodes)
{
    int tries;
    for (tries = 0; tries < 2; tries++) {
        if (sim->needs_sort || tries) GS4I_TRY(gs4i_bin(sim));
        GS4I_TRY(gs4i_scheme_of(sim)->clear(sim, nodes));
        gs4i_scatter(sim, gs4i_scheme_of(sim)->scatter);
        if (!gs4i_all_reports(sim).left_tile) return GS4_OK;
    }
    return gs4i_fail(
        &sim->error, GS4_ERROR_UNSTABLE,
        "particles would move more than a cell beyond the domain in one step, or their "
        "places would not be numbers; the step was not taken");
}

/* Mass and velocities of the nodes, with what walls and colliders take from them. */
static int gs4i_scatter_momenta(gs4_sim *sim, gs4i_node_pass *nodes)
{
    GS4I_TRY(gs4i_rasterise(sim, nodes));
    return gs4i_scheme_of(sim)->set_velocities(sim, nodes);
}

/* Is what the particles have seen so far acceptable, and is dt still within the limit that
 * follows from it? */
static int gs4i_check_stage(gs4_sim *sim)
{
    gs4i_report r = gs4i_all_reports(sim);
    if (r.bad) return gs4i_fail_bad(sim, &r);
    sim->stage_limit = gs4i_stable_dt(sim, &r);
    if (sim->integrator.dt > GS4I_C(1.25) * sim->stage_limit)
        return gs4i_fail_value(&sim->error, GS4_ERROR_UNSTABLE,
                               "viscosity or compression rose during the step: dt ",
                               (double)sim->integrator.dt,
                               " s is beyond the stability limit there; the step was not taken");
    return GS4_OK;
}

/* --- the end of a step ------------------------------------------------------------------------ */

/* A particle takes about 1 ms with so many, a thousand times what it takes else. */
#define GS4I_MANY_SUBSTEPS 1000

/* S8: colliders move, emitters give, what left the domain goes. */
static void gs4i_finish(gs4_sim *sim)
{
    const double dt = (double)sim->integrator.dt;
    if (sim->particles.count) {
        gs4i_report r = gs4i_all_reports(sim);
        r.max_speed = GS4I_SQRT(r.max_speed);
        r.max_gradient = GS4I_SQRT(r.max_gradient);
        sim->limits = r;
        sim->split += (uint64_t)r.split;
        sim->bounded += (uint64_t)r.bounded;
        if (r.substeps > GS4I_MANY_SUBSTEPS * (uint64_t)sim->particles.count)
            gs4i_warn_value(sim, GS4I_WARN_SUBSTEPS, "the non-local stress took ",
                            (double)r.substeps / sim->particles.count,
                            " substeps a particle in one step; shorter steps (max_dt), longer "
                            "relaxation_time and stretch_time or less anisotropy would do");
        if (r.left) gs4i_drop(sim, NULL);
    }
    gs4i_move_bodies(sim, dt);
    gs4i_see_colliders(sim, &sim->limits);
    sim->time += dt;
    sim->last_dt = dt;
    sim->steps++;
    sim->restart = 0;
    sim->shift = sim->integrator.next_shift;
    gs4i_emit(sim);
    if (sim->bad_distance)
        gs4i_warn(sim, GS4I_WARN_DISTANCE,
                  "a distance function (gs4_sdf) gave NaN or infinity at the end of a step: it "
                  "counted as outside there");
}

/* How solids turn whose velocities were set by hand: by the grid, which sees less of it at their
 * surface than there is, hence again with what it saw (kinetic energy that a stiff cube keeps in
 * a quarter of a turn: 0.996 after three times, 0.9999 after ten). A step that is refused
 * forgets it again. */
static void gs4i_forget_spin(gs4_sim *sim)
{
    const gs4i_particles *p = &sim->particles;
    size_t i;
    int k;
    for (i = 0; i < (size_t)p->count && p->with_affine_before; i++)
        for (k = 0; k < 3; k++) { /* the fourth of them is the pressure */
            memset(p->affine[k] + 4 * i, 0, 3 * sizeof(gs4_real));
            memset(p->affine_before[k] + 4 * i, 0, 3 * sizeof(gs4_real));
        }
    for (i = 0; i < (size_t)p->count && p->deformation_reals; i++)
        gs4i_set_spin(&sim->particles, i, gs4i_vec3(0, 0, 0));
}

static int gs4i_find_spin(gs4_sim *sim, gs4i_node_pass *nodes)
{
    const gs4_real ahead = sim->integrator.prediction.ahead;
    int pass, result = GS4_OK;
    sim->integrator.prediction.ahead = 0; /* as it is now, whatever dt is */
    for (pass = 0; pass < 10 && result == GS4_OK; pass++) {
        result = gs4i_scatter_momenta(sim, nodes);
        if (result == GS4_OK) gs4i_gather(sim, gs4i_find_spin_task, 1);
    }
    sim->integrator.prediction.ahead = ahead;
    return result;
}

/* The same for the velocity gradients of particles that give momentum affinely: 16 times bring them
 * to 3e-5 of what they converge to, or their change in the first steps would be an error of first
 * order in time. */
static int gs4i_find_affine(gs4_sim *sim, gs4i_node_pass *nodes)
{
    const gs4i_prediction prediction = sim->integrator.prediction;
    gs4i_staggered *f = &sim->staggered;
    int pass, result = GS4_OK;
    sim->integrator.prediction.ahead = sim->integrator.prediction.bend = 0;
    for (pass = 0; pass < 16 && result == GS4_OK; pass++) {
        result = gs4i_scatter_momenta(sim, nodes);
        if (result != GS4_OK) break;
        gs4i_mirror_faces(sim, f->given, gs4i_fill_given);
        gs4i_gather(sim, gs4i_find_affine_task, 1);
    }
    sim->integrator.prediction = prediction;
    return result;
}

/* Rule (4) for this step, meshes where they are now, and room for what emitters will give. */
static int gs4i_begin_step(gs4_sim *sim, gs4_real dt, gs4i_node_pass *nodes)
{
    int i;
    memset(nodes, 0, sizeof *nodes);
    nodes->sim = sim;
    nodes->lightest = gs4i_max(sim->min_mass * GS4I_EPSILON * GS4I_EPSILON, GS4I_TINY);
    sim->stage_limit = 0;
    sim->integrator = gs4i_make_integrator(sim, dt);
    sim->heat_integrator = gs4i_make_heat_integrator(sim);
    sim->bad_distance = 0;
    for (i = 0; i < sim->boundary.collider_count; i++)
        GS4I_TRY(
            gs4i_field_follow(&sim->error, &sim->memory, &sim->boundary.colliders[i], &sim->grid));
    GS4I_TRY(gs4i_prepare_emitters(sim, (double)dt));
    return gs4i_check_distances(sim);
}

/* S1 to S3: m_i and v_i, with walls and colliders. */
static int gs4i_scatter_state(gs4_sim *sim, gs4i_node_pass *nodes)
{
    if (sim->needs_sort) GS4I_TRY(gs4i_bin(sim));
    if (sim->needs_spin && sim->particles.with_rates)
        GS4I_TRY(sim->particles.with_affine         ? gs4i_find_affine(sim, nodes)
                 : sim->particles.deformation_reals ? gs4i_find_spin(sim, nodes)
                                                    : GS4_OK);
    return gs4i_scatter_momenta(sim, nodes);
}

/* S4 to S6: acc_i and u_i of the nodes, by the scheme; then the limit of dt where they are. */
static int gs4i_accelerate(gs4_sim *sim, gs4i_node_pass *nodes)
{
    GS4I_TRY(gs4i_scheme_of(sim)->accelerate(sim, nodes));
    return gs4i_check_stage(sim);
}

/* Before anything is written to the particles: can the step be trusted? S7 is tried where nodes
 * cannot prove it. */
static int gs4i_validate(gs4_sim *sim, gs4i_node_pass *nodes)
{
    gs4i_report r;
    if (sim->desc.scheme == GS4_EXPLICIT)
        gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), gs4i_node_spreads, nodes);
    gs4i_gather(sim, gs4i_scheme_of(sim)->correct, 0);
    r = gs4i_all_reports(sim);
    return r.bad ? gs4i_fail_bad(sim, &r) : gs4i_check_distances(sim);
}

/* S7: particles see what nodes have, and nodes remember. Nothing can fail any more. */
static void gs4i_correct_particles(gs4_sim *sim, gs4i_node_pass *nodes)
{
    const gs4i_scheme *scheme = gs4i_scheme_of(sim);
    if (scheme->remember) gs4i_parallel_for(&sim->tasks, gs4i_groups(sim), scheme->remember, nodes);
    gs4i_gather(sim, scheme->correct, 1);
}

/* One step of size dt: the stages of the manual. Before gs4i_correct_particles nothing of the
 * state is written, so that a step can be refused. */
static int gs4i_make_step(gs4_sim *sim, gs4_real dt)
{
    gs4i_node_pass nodes;
    GS4I_TRY(gs4i_begin_step(sim, dt, &nodes));
    if (sim->particles.count) {
        GS4I_TRY(gs4i_scatter_state(sim, &nodes));
        GS4I_TRY(gs4i_accelerate(sim, &nodes));
        if (sim->particles.with_heat) GS4I_TRY(gs4i_solve_heat(sim, &nodes));
        GS4I_TRY(gs4i_validate(sim, &nodes));
        gs4i_correct_particles(sim, &nodes);
    }
    gs4i_finish(sim);
    return GS4_OK;
}

/* A step that is refused forgets the spin that it found. */
static int gs4i_step(gs4_sim *sim, gs4_real dt)
{
    const double start = gs4i_now(sim);
    const int result = gs4i_make_step(sim, dt);
    if (result == GS4_OK) {
        sim->needs_spin = 0;
        sim->seconds[GS4I_CLOCK_TOTAL] += gs4i_since(sim, start);
    } else if (sim->needs_spin)
        gs4i_forget_spin(sim);
    return result;
}

/* ==== [[files]] frames and checkpoints ======================================================== */

/* A file that appears under its name only when it is whole: written beside it under a name of its
 * own, then renamed. Where the path is a symbolic link that happens where the link leads. What is
 * not a regular file (a device, a pipe) is written directly. */
typedef struct gs4i_file {
    FILE *stream;
    char *names; /* the block of both: */
    size_t size; /* bytes of each */
    char *target, *temporary;
    int failed;
    uint64_t hash;
} gs4i_file;

typedef enum gs4i_place_kind {
    GS4I_PLACE_FREE, /* or a regular file */
    GS4I_PLACE_FOLDER,
    GS4I_PLACE_SPECIAL
} gs4i_place_kind;

enum {
    GS4I_LONGEST_LINK = 4096,
    GS4I_MOST_LINKS = 40,
    GS4I_MOST_NAMES = 1000 /* of neighbours, left by programs that were killed */
};

#ifdef _WIN32
#define GS4I_BACKSLASHES 1
#else
#define GS4I_BACKSLASHES 0
#endif

/* A new file; NULL where there is one of that name already. */
static FILE *gs4i_open_exclusively(const char *path)
{
#if defined(_WIN32) && !defined(_UCRT) && !(defined(_MSC_VER) && _MSC_VER >= 1900)
    FILE *there = fopen(path, "rb"); /* msvcrt knows no "x" */
    if (!there) return fopen(path, "wb");
    fclose(there);
    return NULL;
#else
    return fopen(path, "wbx");
#endif
}

static gs4i_place_kind gs4i_kind_of_place(const char *path)
{
#if defined(__unix__) || defined(__APPLE__)
    struct stat s;
    if (stat(path, &s) != 0 || S_ISREG(s.st_mode)) return GS4I_PLACE_FREE;
    return S_ISDIR(s.st_mode) ? GS4I_PLACE_FOLDER : GS4I_PLACE_SPECIAL;
#else
    (void)path;
    return GS4I_PLACE_FREE;
#endif
}

/* Bytes of a path up to the name in its folder. */
static size_t gs4i_folder_length(const char *path)
{
    size_t i, n = 0;
    for (i = 0; path[i]; i++)
        if (path[i] == '/' || (GS4I_BACKSLASHES && (path[i] == '\\' || path[i] == ':'))) n = i + 1;
    return n;
}

/* Replace the path by where it leads while it is a symbolic link; `text` has room for one.
 * GS4_ERROR_IO: they lead too far, or round and round. */
static int gs4i_follow_links(char *path, size_t size, char *text)
{
#if defined(__unix__) || defined(__APPLE__)
#if !defined(__cplusplus) && defined(__STRICT_ANSI__)
    extern ssize_t readlink(const char *path, char *text, size_t size);
#endif
    int links;
    for (links = 0; links < GS4I_MOST_LINKS; links++) {
        const ssize_t n = readlink(path, text, GS4I_LONGEST_LINK);
        size_t folder = n > 0 && text[0] != '/' ? gs4i_folder_length(path) : 0;
        if (n <= 0) return GS4_OK;
        if (folder + (size_t)n >= size) return GS4_ERROR_IO;
        memcpy(path + folder, text, (size_t)n);
        path[folder + (size_t)n] = 0;
    }
    return GS4_ERROR_IO;
#else
    (void)path;
    (void)size;
    (void)text;
    return GS4_OK;
#endif
}

/* What could not be done with a file, and which. */
static int gs4i_fail_file(gs4_sim *sim, gs4i_file *f, const char *what, const char *path)
{
    gs4i_text t = gs4i_begin_error(&sim->error);
    gs4i_put(&t, what);
    gs4i_put(&t, ": ");
    gs4i_put(&t, path);
    gs4i_free(&sim->memory, f->names, 2 * f->size, 1);
    return gs4i_end_error(&sim->error, GS4_ERROR_IO);
}

/* Open a new file in the folder of the target, by the first of some names that nothing has. */
static int gs4i_open_neighbour(const gs4_sim *sim, gs4i_file *f)
{
    const size_t folder = gs4i_folder_length(f->target);
    const uintptr_t self = (uintptr_t)sim;
    uint64_t number = gs4i_hash_bytes(sim->steps, &self, sizeof self);
    int tries, i;
    for (tries = 0; tries < GS4I_MOST_NAMES && !f->stream; tries++) {
        gs4i_text t = gs4i_text_into(f->temporary, f->size);
        char digits[9];
        number = gs4i_mix(number);
        for (i = 0; i < 8; i++) digits[i] = "0123456789abcdef"[number >> 4 * i & 15];
        digits[8] = 0;
        memcpy(f->temporary, f->target, folder);
        t.at += folder;
        t.left -= folder;
        gs4i_put(&t, "gs4mpm-");
        gs4i_put(&t, digits);
        gs4i_put(&t, ".tmp");
        f->stream = gs4i_open_exclusively(f->temporary);
    }
    return f->stream ? GS4_OK : GS4_ERROR_IO;
}

static GS4I_COLD int gs4i_file_open(gs4_sim *sim, gs4i_file *f, const char *path)
{
    gs4i_place_kind kind;
    memset(f, 0, sizeof *f);
    if (!path || !*path) return gs4i_fail(&sim->error, GS4_ERROR_ARGUMENT, "path is empty");
    kind = gs4i_kind_of_place(path);
    if (kind == GS4I_PLACE_FOLDER)
        return gs4i_fail_file(sim, f, "path is that of a folder, give that of a file", path);
    if (kind == GS4I_PLACE_SPECIAL) {
        f->stream = fopen(path, "wb");
        return f->stream ? GS4_OK : gs4i_fail_file(sim, f, "path could not be written to", path);
    }
    f->size = strlen(path) + GS4I_LONGEST_LINK + 64;
    f->names = (char *)gs4i_alloc(&sim->memory, 2 * f->size, 1);
    if (!f->names) return gs4i_fail_memory(&sim->error);
    f->target = f->names;
    f->temporary = f->names + f->size;
    memcpy(f->target, path, strlen(path));
    if (gs4i_follow_links(f->target, f->size - 64, f->temporary) != GS4_OK)
        return gs4i_fail_file(
            sim, f, "path is a symbolic link that leads too far, or round and round", path);
    if (gs4i_open_neighbour(sim, f) == GS4_OK) return GS4_OK;
    return gs4i_fail_file(sim, f,
                          "no file could be created beside path: does its folder exist, and may it "
                          "be written to?",
                          path);
}

static void gs4i_file_put(gs4i_file *f, const void *data, size_t bytes)
{
    if (bytes == 0) return;
    if (!f->failed && fwrite(data, 1, bytes, f->stream) != bytes) f->failed = 1;
    f->hash = gs4i_hash_bytes(f->hash, data, bytes);
}

static int gs4i_file_close(gs4_sim *sim, gs4i_file *f)
{
    int failed = f->failed;
    if (fflush(f->stream) != 0 || ferror(f->stream)) failed = 1;
    if (fclose(f->stream) != 0) failed = 1;
    if (failed && f->temporary) remove(f->temporary);
    if (failed)
        return gs4i_fail_file(sim, f,
                              "the file could not be written whole: is the disk full? What was "
                              "there before is untouched",
                              f->names ? f->target : "a device");
    if (!f->temporary) return GS4_OK;
#ifdef _WIN32
    remove(f->target); /* rename does not replace there */
#endif
    failed = rename(f->temporary, f->target) != 0;
    if (failed) {
        remove(f->temporary);
        return gs4i_fail_file(sim, f,
                              "the file was written, but could not take its name: is it too long, "
                              "or that of a folder or of a file that must not be replaced?",
                              f->target);
    }
    gs4i_free(&sim->memory, f->names, 2 * f->size, 1);
    return GS4_OK;
}

/* Columns of a frame, in order. Frames are little-endian; on a big-endian machine numbers are
 * turned round. */
enum {
    GS4I_COLUMNS = 12
};
typedef struct gs4i_column {
    const char *name;
    const char *ply;
    const char *npy;
    const void *data;
    size_t size;
    int numbers;
    size_t stride;
} gs4i_column;

/* Number i of the first row; NULL where there are none. */
static const gs4_real *gs4i_from_number(const gs4_real *rows, int i)
{
    return rows ? rows + i : NULL;
}

static GS4I_COLD int gs4i_columns(gs4_sim *sim, gs4i_column c[GS4I_COLUMNS])
{
    gs4i_particles *p = &sim->particles;
    const char *real_ply = sizeof(gs4_real) == 4 ? "float" : "double",
               *real_npy = sizeof(gs4_real) == 4 ? "<f4" : "<f8";
    const size_t r = sizeof(gs4_real);
    int n = 0;
    const gs4i_column columns[] = {
        { "position", real_ply, real_npy, p->position, r, 3, 4 * r },
        { "velocity", real_ply, real_npy, p->velocity, r, 3, 4 * r },
        { "volume_ratio", real_ply, real_npy, gs4i_from_number(p->velocity, 3), r, 1, 4 * r },
        { "mass", real_ply, real_npy, gs4i_from_number(p->position, 3), r, 1, 4 * r },
        { "id", "uint", "<u4", p->id, 4, 1, 4 },
        { "material", "uchar", "|u1", p->material, 1, 1, 1 }
    };
    const gs4i_column stress = {
        "stress", real_ply, real_npy, p->elastic, r, 6, (size_t)p->elastic_reals * r
    };
    const gs4i_column deformation = {
        "deformation", real_ply, real_npy, p->deformation, r, 9, (size_t)p->deformation_reals * r
    };
    const gs4i_column temperature = { "temperature", real_ply, real_npy, p->heat, r, 1, 4 * r };
    const gs4i_column fraction = {
        "liquid_fraction", real_ply, real_npy, gs4i_from_number(p->heat, 1), r, 1, 4 * r
    };
    const gs4i_column flux = { "flux", real_ply, real_npy, p->flux, r, 3, 4 * r };
    const gs4i_column pressure = {
        "pressure", real_ply, real_npy, gs4i_from_number(p->affine[0], 3), r, 1, 4 * r
    };
    for (; n < (int)(sizeof columns / sizeof columns[0]); n++) c[n] = columns[n];
    if (p->elastic_reals) c[n++] = stress;
    if (p->deformation_reals) c[n++] = deformation;
    if (p->with_heat) {
        c[n++] = temperature;
        c[n++] = fraction;
    }
    if (p->with_flux) c[n++] = flux;
    if (sim->desc.scheme != GS4_EXPLICIT) c[n++] = pressure;
    if (p->count == 0) {
        int i;
        for (i = 0; i < n; i++) c[i].data = &sim->particles;
    }
    return n;
}

/* Record after record, through a buffer. */
static GS4I_COLD void gs4i_put_records(gs4i_file *f, const gs4i_column *c, int columns, int count)
{
    const uint16_t one = 1;
    const int big = *(const unsigned char *)&one == 0;
    unsigned char buffer[8192];
    size_t used = 0, b;
    int i, k, e;
    for (i = 0; i < count; i++) {
        if (used + 256 > sizeof buffer) {
            gs4i_file_put(f, buffer, used);
            used = 0;
        }
        for (k = 0; k < columns; k++)
            for (e = 0; e < c[k].numbers; e++) {
                const unsigned char *from = (const unsigned char *)c[k].data
                                            + (size_t)i * c[k].stride + (size_t)e * c[k].size;
                for (b = 0; b < c[k].size; b++) buffer[used++] = from[big ? c[k].size - 1 - b : b];
            }
    }
    gs4i_file_put(f, buffer, used);
}

static GS4I_COLD int gs4i_write_ply(gs4_sim *sim, const char *path)
{
    static const char *const axis[3] = { "x", "y", "z" }, *const tensor[6] = { "xx", "yy", "zz",
                                                                               "xy", "xz", "yz" };
    gs4i_column c[GS4I_COLUMNS];
    gs4i_file f;
    gs4i_text t;
    char head[1024];
    int columns = gs4i_columns(sim, c), k, e;
    GS4I_TRY(gs4i_file_open(sim, &f, path));
    t.at = head;
    t.left = sizeof head;
    gs4i_put(&t, "ply\nformat binary_little_endian 1.0\ncomment gs4mpm " GS4_VERSION_STRING
                 "\ncomment time ");
    gs4i_put_real(&t, sim->time);
    gs4i_put(&t, "\nelement vertex ");
    gs4i_put_integer(&t, sim->particles.count);
    for (k = 0; k < columns; k++)
        for (e = 0; e < c[k].numbers; e++) {
            gs4i_put(&t, "\nproperty ");
            gs4i_put(&t, c[k].ply);
            gs4i_put(&t, " ");
            if (c[k].numbers == 1)
                gs4i_put(&t, c[k].name);
            else if (c[k].numbers == 6) {
                gs4i_put(&t, "stress_");
                gs4i_put(&t, tensor[e]);
            } else if (c[k].numbers == 9) {
                gs4i_put(&t, "F_");
                gs4i_put(&t, axis[e / 3]);
                gs4i_put(&t, axis[e % 3]);
            } else {
                gs4i_put(&t, k == 0 ? "" : k == 1 ? "v" : "flux_");
                gs4i_put(&t, axis[e]);
            }
        }
    gs4i_put(&t, "\nend_header\n");
    gs4i_file_put(&f, head, strlen(head));
    gs4i_put_records(&f, c, columns, sim->particles.count);
    return gs4i_file_close(sim, &f);
}

/* NumPy's .npy, version 1.0: magic, length of the header, a header that is Python text padded to
 * 64 bytes, records. */
static GS4I_COLD int gs4i_write_raw(gs4_sim *sim, const char *path)
{
    gs4i_column c[GS4I_COLUMNS];
    gs4i_file f;
    gs4i_text t;
    char head[1024];
    int columns = gs4i_columns(sim, c), k;
    size_t n;
    GS4I_TRY(gs4i_file_open(sim, &f, path));
    memset(head, ' ', sizeof head);
    memcpy(head, "\x93NUMPY\x01\x00", 8);
    t.at = head + 10;
    t.left = sizeof head - 128;
    gs4i_put(&t, "{'descr': [");
    for (k = 0; k < columns; k++) {
        gs4i_put(&t, "('");
        gs4i_put(&t, c[k].name);
        gs4i_put(&t, "', '");
        gs4i_put(&t, c[k].npy);
        gs4i_put(&t, c[k].numbers == 3   ? "', (3,)), "
                     : c[k].numbers == 6 ? "', (6,)), "
                     : c[k].numbers == 9 ? "', (3, 3)), "
                                         : "'), ");
    }
    gs4i_put(&t, "], 'fortran_order': False, 'shape': (");
    gs4i_put_integer(&t, sim->particles.count);
    gs4i_put(&t, ",), }");
    n = (size_t)(t.at - head);
    head[n] = ' ';
    while ((n + 1) % 64) n++;
    head[n++] = '\n';
    head[8] = (char)((n - 10) & 255);
    head[9] = (char)((n - 10) >> 8);
    gs4i_file_put(&f, head, n);
    gs4i_put_records(&f, c, columns, sim->particles.count);
    return gs4i_file_close(sim, &f);
}

/* --- checkpoints: native byte order, made for the same build; a hash of everything stands at
 * the end */

typedef struct gs4i_head {
    char magic[8];
    uint32_t version, real_size, byte_order, head_size, material_size, collider_size, emitter_size;
    int32_t cells[3], scheme, integrator, walls[6];
    double cell_size, origin[3], gravity[3], rho[2], decay, heat[7];
    int32_t isothermal[7], deconvolved; /* walls, air */
    double time, last_dt;
    uint64_t steps;
    uint32_t next_id;
    int32_t restart, needs_sort, limits_stale, needs_spin;
    double min_mass, max_mass, top_speed, shift;
    int32_t particles, materials, colliders, emitters, active, occupied, elastic_reals,
        deformation_reals, with_heat, with_flux;
    uint64_t split, bounded;
    gs4i_report limits;
} gs4i_head;

static GS4I_COLD void gs4i_head_of(const gs4_sim *sim, gs4i_head *h)
{
    const gs4_sim_desc *d = &sim->desc;
    int i;
    memset(h, 0, sizeof *h);
    memcpy(h->magic, "GS4SAVE", 8);
    h->version = GS4_VERSION;
    h->real_size = sizeof(gs4_real);
    h->byte_order = 0x01020304u;
    h->head_size = sizeof *h;
    h->material_size = sizeof(gs4i_material_constants);
    h->collider_size = sizeof(gs4i_collider);
    h->emitter_size = sizeof(gs4i_emitter);
    for (i = 0; i < 3; i++) h->cells[i] = d->cells[i];
    for (i = 0; i < 6; i++) h->walls[i] = (int32_t)d->walls[i];
    h->scheme = (int32_t)d->scheme;
    h->integrator = (int32_t)d->integrator;
    h->deconvolved = d->sharp_gradients != 0;
    h->cell_size = (double)d->cell_size;
    h->origin[0] = (double)d->origin.x;
    h->origin[1] = (double)d->origin.y;
    h->origin[2] = (double)d->origin.z;
    h->gravity[0] = (double)d->gravity.x;
    h->gravity[1] = (double)d->gravity.y;
    h->gravity[2] = (double)d->gravity.z;
    h->rho[0] = (double)d->rho_inf;
    h->rho[1] = (double)d->rho_inf_spurious;
    h->decay = (double)d->flip_decay_time;
    for (i = 0; i < 6; i++) {
        h->heat[i] = (double)d->wall_temperature[i];
        h->isothermal[i] = d->wall_is_isothermal[i] != 0;
    }
    h->heat[6] = (double)d->ambient_temperature;
    h->isothermal[6] = d->air_is_isothermal != 0;
    h->time = sim->time;
    h->last_dt = sim->last_dt;
    h->steps = sim->steps;
    h->next_id = sim->next_id;
    h->restart = sim->restart;
    h->needs_sort = sim->needs_sort;
    h->limits_stale = sim->limits_stale;
    h->needs_spin = sim->needs_spin;
    h->min_mass = (double)sim->min_mass;
    h->max_mass = (double)sim->max_mass;
    h->top_speed = (double)sim->top_speed;
    h->shift = (double)sim->shift;
    h->particles = sim->particles.count;
    h->materials = sim->material_count;
    h->colliders = sim->boundary.collider_count;
    h->emitters = sim->emitter_count;
    h->active = sim->grid.active;
    h->occupied = sim->grid.occupied;
    h->elastic_reals = sim->particles.elastic_reals;
    h->deformation_reals = sim->particles.deformation_reals;
    h->with_heat = sim->particles.with_heat;
    h->with_flux = sim->particles.with_flux;
    h->split = sim->split;
    h->bounded = sim->bounded;
    h->limits = sim->limits;
}

static GS4I_COLD int gs4i_save(gs4_sim *sim, const char *path)
{
    gs4i_array a[GS4I_ARRAYS];
    gs4i_file f;
    gs4i_head head;
    uint64_t hash;
    int k;
    GS4I_TRY(gs4i_file_open(sim, &f, path));
    gs4i_head_of(sim, &head);
    gs4i_particle_arrays(&sim->particles, a);
    gs4i_file_put(&f, &head, sizeof head);
    gs4i_file_put(&f, sim->constants, (size_t)sim->material_count * sizeof *sim->constants);
    gs4i_file_put(&f, sim->boundary.colliders,
                  (size_t)sim->boundary.collider_count * sizeof *sim->boundary.colliders);
    gs4i_file_put(&f, sim->emitters, (size_t)sim->emitter_count * sizeof *sim->emitters);
    for (k = 0; k < GS4I_STATE_ARRAYS; k++)
        if (a[k].wanted) gs4i_file_put(&f, *a[k].data, (size_t)sim->particles.count * a[k].size);
    gs4i_file_put(&f, sim->grid.occupied_block,
                  (size_t)sim->grid.occupied * sizeof *sim->grid.occupied_block);
    gs4i_file_put(&f, sim->grid.first, ((size_t)sim->grid.occupied + 1) * sizeof *sim->grid.first);
    gs4i_file_put(&f, sim->grid.block, (size_t)sim->grid.active * sizeof *sim->grid.block);
    if (sim->grid.remembered) {
        gs4i_file_put(&f, sim->grid.remembered,
                      (size_t)sim->grid.active * GS4I_NODE_REALS * sizeof(gs4_real));
        gs4i_file_put(&f, sim->grid.flags, (size_t)sim->grid.active * GS4I_BLOCK_NODES);
    }
    hash = f.hash;
    gs4i_file_put(&f, &hash, sizeof hash);
    return gs4i_file_close(sim, &f);
}

static void gs4i_forget_pointers(gs4_shape *s)
{
    s->distance = NULL;
    s->user = NULL;
    s->vertices = NULL;
    s->triangles = NULL;
}

/* Does the head belong to this build, this description and this scene? */
static int gs4i_check_head(gs4_sim *sim, const gs4i_head *h)
{
    gs4i_head own;
    gs4i_head_of(sim, &own);
    if (memcmp(h->magic, own.magic, 8) != 0)
        return gs4i_fail(&sim->error, GS4_ERROR_FORMAT, "the file is not a gs4mpm checkpoint");
    if (h->version != own.version || h->real_size != own.real_size
        || h->byte_order != own.byte_order || h->head_size != own.head_size
        || h->material_size != own.material_size || h->collider_size != own.collider_size
        || h->emitter_size != own.emitter_size)
        return gs4i_fail(&sim->error, GS4_ERROR_FORMAT,
                         "the checkpoint was made by another build (version, precision, byte order "
                         "or platform)");
    if (memcmp(h->cells, own.cells, sizeof h->cells) || memcmp(h->walls, own.walls, sizeof h->walls)
        || h->scheme != own.scheme || h->integrator != own.integrator
        || h->deconvolved != own.deconvolved
        || memcmp(&h->cell_size, &own.cell_size, sizeof h->cell_size)
        || memcmp(h->origin, own.origin, sizeof h->origin)
        || memcmp(h->gravity, own.gravity, sizeof h->gravity)
        || memcmp(h->rho, own.rho, sizeof h->rho) || memcmp(&h->decay, &own.decay, sizeof h->decay)
        || memcmp(h->heat, own.heat, sizeof h->heat)
        || memcmp(h->isothermal, own.isothermal, sizeof h->isothermal))
        return gs4i_fail(&sim->error, GS4_ERROR_FORMAT,
                         "the checkpoint belongs to a simulation with another description");
    if (h->materials != own.materials || h->colliders != own.colliders
        || h->emitters != own.emitters || h->elastic_reals != own.elastic_reals
        || h->deformation_reals != own.deformation_reals || h->with_heat != own.with_heat
        || h->with_flux != own.with_flux)
        return gs4i_fail(&sim->error, GS4_ERROR_FORMAT,
                         "the checkpoint belongs to a scene with other materials, colliders or "
                         "emitters: add the same ones, in the same order, before gs4_load");
    if (h->particles < 0 || h->active < 0 || h->occupied < 0 || h->particles > GS4I_MAX_PARTICLES
        || (size_t)h->active > sim->grid.table_count
        || h->occupied > h->active
        /* more bytes than size_t can say: a particle has less than 2^10, a block than 2^13 */
        || ((uint64_t)h->particles << 10) + ((uint64_t)h->active << 13) > SIZE_MAX / 2)
        return gs4i_fail(&sim->error, GS4_ERROR_FORMAT, "the checkpoint is damaged");
    if (sim->desc.max_particles && h->particles > sim->desc.max_particles)
        return gs4i_fail(&sim->error, GS4_ERROR_ARGUMENT,
                         "the checkpoint holds more particles than max_particles");
    return GS4_OK;
}

/* The pieces of a checkpoint in the order of the file, and where they are in memory. */
enum {
    GS4I_PIECES = GS4I_STATE_ARRAYS + 9
};
typedef struct gs4i_pieces {
    size_t size[GS4I_PIECES];
    const unsigned char *at[GS4I_PIECES];
} gs4i_pieces;
enum {
    GS4I_PIECE_CONSTANTS,
    GS4I_PIECE_COLLIDERS,
    GS4I_PIECE_EMITTERS,
    GS4I_PIECE_OCCUPIED,
    GS4I_PIECE_FIRST,
    GS4I_PIECE_BLOCKS,
    GS4I_PIECE_REMEMBERED,
    GS4I_PIECE_FLAGS,
    GS4I_PIECE_PARTICLES
};

/* Sizes from the head; the bytes of all pieces. */
static size_t gs4i_piece_sizes(gs4_sim *sim, const gs4i_head *h, gs4i_pieces *p)
{
    gs4i_particles store = sim->particles;
    gs4i_array a[GS4I_ARRAYS];
    size_t sum = 0;
    int k;
    memset(p, 0, sizeof *p);
    store.elastic_reals = h->elastic_reals;
    store.deformation_reals = h->deformation_reals;
    gs4i_particle_arrays(&store, a);
    p->size[GS4I_PIECE_CONSTANTS] = (size_t)h->materials * sizeof(gs4i_material_constants);
    p->size[GS4I_PIECE_COLLIDERS] = (size_t)h->colliders * sizeof(gs4i_collider);
    p->size[GS4I_PIECE_EMITTERS] = (size_t)h->emitters * sizeof(gs4i_emitter);
    p->size[GS4I_PIECE_OCCUPIED] = (size_t)h->occupied * 4;
    p->size[GS4I_PIECE_FIRST] = (size_t)h->occupied * 4 + 4;
    p->size[GS4I_PIECE_BLOCKS] = (size_t)h->active * 4;
    if (sim->particles.with_rates) {
        p->size[GS4I_PIECE_REMEMBERED] = (size_t)h->active * GS4I_NODE_REALS * sizeof(gs4_real);
        p->size[GS4I_PIECE_FLAGS] = (size_t)h->active * GS4I_BLOCK_NODES;
    }
    for (k = 0; k < GS4I_STATE_ARRAYS; k++)
        if (a[k].wanted) p->size[GS4I_PIECE_PARTICLES + k] = (size_t)h->particles * a[k].size;
    for (k = 0; k < GS4I_PIECES; k++) sum += p->size[k];
    return sum;
}

/* Are the materials, colliders and emitters here those of the file? Pointers and what moves are
 * left out. */
static int gs4i_same_scene(const gs4_sim *sim, const gs4i_pieces *p)
{
    int i;
    for (i = 0; i < sim->material_count; i++) {
        gs4i_material_constants there, here = sim->constants[i];
        memcpy(&there, p->at[GS4I_PIECE_CONSTANTS] + (size_t)i * sizeof there, sizeof there);
        there.is.viscosity_fn = here.is.viscosity_fn;
        there.is.viscosity_user = here.is.viscosity_user;
        if (memcmp(&there.is, &here.is, sizeof here.is) != 0) return 0;
    }
    for (i = 0; i < sim->boundary.collider_count; i++) {
        gs4i_collider there, here = sim->boundary.colliders[i];
        memcpy(&there, p->at[GS4I_PIECE_COLLIDERS] + (size_t)i * sizeof there, sizeof there);
        gs4i_forget_pointers(&there.is.shape);
        gs4i_forget_pointers(&here.is.shape);
        if (memcmp(&there.is.shape, &here.is.shape, sizeof here.is.shape)
            || there.is.contact != here.is.contact || there.is_emitter != here.is_emitter
            || memcmp(&there.is.friction, &here.is.friction, sizeof here.is.friction)
            || memcmp(&there.is.temperature, &here.is.temperature, sizeof here.is.temperature)
            || memcmp(&there.is.pivot, &here.is.pivot, sizeof here.is.pivot)
            || there.is.is_isothermal != here.is.is_isothermal)
            return 0;
    }
    for (i = 0; i < sim->emitter_count; i++) {
        gs4i_emitter there, here = sim->emitters[i];
        memcpy(&there, p->at[GS4I_PIECE_EMITTERS] + (size_t)i * sizeof there, sizeof there);
        if (memcmp(&there.is.fill, &here.is.fill, sizeof here.is.fill)
            || memcmp(&there.is.start, &here.is.start, sizeof here.is.start)
            || memcmp(&there.is.stop, &here.is.stop, sizeof here.is.stop)
            || there.collider != here.collider)
            return 0;
    }
    return 1;
}

/* Take from the file what moves of colliders and emitters. All else is that of those here: it is
 * the same, follows from what is, or cannot be saved (callbacks and meshes). */
static void gs4i_restore_scene(gs4_sim *sim, const gs4i_pieces *p)
{
    int i;
    for (i = 0; i < sim->boundary.collider_count; i++) {
        gs4i_collider there, *b = &sim->boundary.colliders[i];
        memcpy(&there, p->at[GS4I_PIECE_COLLIDERS] + (size_t)i * sizeof there, sizeof there);
        b->is.velocity = there.is.velocity;
        b->is.angular_velocity = there.is.angular_velocity;
        b->is_off = there.is_off != 0;
        memcpy(b->at, there.at, sizeof b->at);
        memcpy(b->turn, there.turn, sizeof b->turn);
        gs4i_collider_orient(b);
    }
    for (i = 0; i < sim->emitter_count; i++) {
        gs4i_emitter there, *e = &sim->emitters[i];
        memcpy(&there, p->at[GS4I_PIECE_EMITTERS] + (size_t)i * sizeof there, sizeof there);
        e->flowed = there.flowed;
        e->emitted = there.emitted;
        e->has_emitted = there.has_emitted != 0;
        e->is.travel = sim->boundary.colliders[e->collider].is.velocity;
    }
}

/* Numbers of a file are checked like those of a user: it may be forged. */
static int gs4i_are_sane(const gs4_real *v, int n)
{
    int i, sane = 1;
    for (i = 0; i < n; i++) sane &= v[i] < GS4I_HUGE && v[i] > -GS4I_HUGE;
    return sane;
}

/* Rates, gradients and fluxes have more room: speeds over the time of a cell go as their square. */
static int gs4i_are_rates(const gs4_real *v, int n)
{
    const gs4_real most = GS4I_HUGE * GS4I_HUGE;
    int i, sane = 1;
    for (i = 0; i < n; i++) sane &= v[i] < most && v[i] > -most;
    return sane;
}

static int gs4i_is_place(const double at[3])
{
    return fabs(at[0]) < (double)GS4I_HUGE && fabs(at[1]) < (double)GS4I_HUGE
           && fabs(at[2]) < (double)GS4I_HUGE;
}

/* Of the head: times, extremes that set the limit, flags. */
static int gs4i_head_is_sound(const gs4i_head *h)
{
    const double times[6] = {
        h->time, h->last_dt, h->top_speed, h->min_mass, h->max_mass, h->shift
    };
    const gs4_real limits[7] = { h->limits.max_speed,     h->limits.max_gradient,
                                 h->limits.min_J,         h->limits.max_J,
                                 h->limits.max_viscosity, h->limits.max_sound,
                                 h->limits.max_stiffness };
    int i, sound = 1;
    for (i = 0; i < 6; i++) sound &= times[i] >= 0 && times[i] <= (double)GS4I_HUGE;
    for (i = 0; i < 7; i++) sound &= limits[i] >= 0 && gs4i_finite(limits[i]);
    return sound && (h->restart | h->needs_sort | h->limits_stale | h->needs_spin) >> 1 == 0
           && (h->min_mass > 0 || h->particles == 0) && h->max_mass >= h->min_mass;
}

/* Of what moves. */
static int gs4i_motions_are_sound(const gs4i_head *h, const gs4i_pieces *p)
{
    const double far_away = 1e12 * h->cell_size; /* whole numbers of a lattice end there */
    int i, k;
    for (i = 0; i < h->colliders; i++) {
        gs4i_collider b;
        double norm = 0;
        memcpy(&b, p->at[GS4I_PIECE_COLLIDERS] + (size_t)i * sizeof b, sizeof b);
        for (k = 0; k < 4; k++) norm += b.turn[k] * b.turn[k];
        if (!gs4i_is_place(b.at) || !(fabs(norm - 1) < 1e-9) || !gs4i_are_sane(&b.is.velocity.x, 1)
            || !gs4i_are_sane(&b.is.velocity.y, 1) || !gs4i_are_sane(&b.is.velocity.z, 1)
            || !gs4i_are_sane(&b.is.angular_velocity.x, 1)
            || !gs4i_are_sane(&b.is.angular_velocity.y, 1)
            || !gs4i_are_sane(&b.is.angular_velocity.z, 1))
            return 0;
    }
    for (i = 0; i < h->emitters; i++) {
        gs4i_emitter e;
        memcpy(&e, p->at[GS4I_PIECE_EMITTERS] + (size_t)i * sizeof e, sizeof e);
        if (!(e.emitted >= 0 && e.flowed >= e.emitted && e.flowed < far_away)) return 0;
    }
    return 1;
}

/* Is F that of a particle whose volume ratio is J? det F = J, but for the rounding of F, which F
 * that stretches by 512 and presses by as much makes 2e-2 of it in float. */
static int gs4i_deformation_is_sound(const gs4_real *F, double J)
{
    double one[3][3];
    int i;
    for (i = 0; i < 9; i++) one[i / 3][i % 3] = (double)F[i];
    return fabs(gs4i_determinant(one) - J) <= 0.1 * J;
}

/* Of particle i. */
static int gs4i_particle_is_sound(const gs4_sim *sim, const gs4i_head *h, size_t i)
{
    const gs4i_particles *p = &sim->particles;
    const gs4_real *x = p->position + 4 * i, *v = p->velocity + 4 * i, h1 = sim->grid.h;
    int k, sound = p->material[i] < sim->material_count && p->id[i] < h->next_id
                   && gs4i_is_in_domain(&sim->grid, x) && gs4i_are_sane(v, 3) && v[3] > GS4I_J_LOW
                   && v[3] < GS4I_J_HIGH && (double)x[3] >= h->min_mass
                   && (double)x[3] <= h->max_mass;
    /* the largest that gs4_add_points takes */
    sound = sound && x[3] <= 9 * h1 * h1 * h1 * sim->constants[p->material[i]].density;
    for (k = 0; k < 3 && p->affine[k]; k++)
        sound &= gs4i_are_rates(p->affine[k] + 4 * i, p->with_affine_before ? 4 : 3);
    for (k = 0; k < 3 && p->affine_before[k]; k++)
        sound &= gs4i_are_rates(p->affine_before[k] + 4 * i, 3);
    if (p->with_rates) {
        sound &= gs4i_are_rates(p->rate + 4 * i, 4);
        for (k = 0; k < 4; k++)
            sound &= gs4i_finite(gs4i_from_half(p->position_residual[4 * i + (size_t)k]));
    }
    if (p->elastic_reals)
        sound &= gs4i_are_sane(p->elastic + (size_t)p->elastic_reals * i, 6)
                 && gs4i_are_rates(p->elastic + (size_t)p->elastic_reals * i, p->elastic_reals);
    if (p->deformation_reals)
        sound &= gs4i_deformation_is_sound(p->deformation + (size_t)p->deformation_reals * i,
                                           (double)v[3])
                 && gs4i_are_sane(p->deformation + (size_t)p->deformation_reals * i, 9)
                 && gs4i_are_rates(p->deformation + (size_t)p->deformation_reals * i,
                                   p->deformation_reals);
    if (p->with_heat)
        sound &= gs4i_are_sane(p->heat + 4 * i, 1) && gs4i_are_rates(p->heat + 4 * i, 4)
                 && p->heat[4 * i + 1] >= 0 && p->heat[4 * i + 1] <= 1 && p->liquid[i] <= 1;
    if (p->with_flux)
        sound &= gs4i_are_rates(p->flux + 4 * i, 3) && gs4i_are_rates(p->flux_rate + 4 * i, 3);
    return sound;
}

/* Is each number one that a simulation may hold? */
static int gs4i_state_is_sound(const gs4_sim *next, const gs4i_head *h, const gs4i_pieces *p)
{
    const gs4i_grid *g = &next->grid;
    uint32_t n, nodes = g->remembered ? (uint32_t)g->active * GS4I_BLOCK_NODES : 0;
    size_t i;
    if (!gs4i_head_is_sound(h) || !gs4i_motions_are_sound(h, p)) return 0;
    for (i = 0; i < (size_t)h->particles; i++)
        if (!gs4i_particle_is_sound(next, h, i)) return 0;
    for (n = 0; n < nodes; n++) {
        const gs4_real *ag = gs4i_of_node(g->remembered, gs4i_first_node(0) + n);
        if (!gs4i_are_rates(ag, 3) || ag[3] != 0) return 0; /* the lane of mass has no rate */
    }
    return 1;
}

/* Occupied blocks must be ascending, inside the domain and cover the particles in order; those
 * with nodes ascending too. */
static int gs4i_blocks_are_sound(const gs4_sim *sim, const gs4i_head *h, const uint32_t *block,
                                 const int32_t *first, const uint32_t *active)
{
    int i, a, at[3];
    for (i = 0; i < h->active; i++)
        if (active[i] >= sim->grid.table_count || (i && active[i] <= active[i - 1])) return 0;
    if (h->occupied == 0) return h->needs_sort || h->particles == 0;
    if (first[0] != 0
        || (h->needs_sort ? first[h->occupied] < 0 : first[h->occupied] != h->particles))
        return 0;
    for (i = 0; i < h->occupied; i++) {
        if (first[i] > first[i + 1] || block[i] >= sim->grid.table_count
            || (i && block[i] <= block[i - 1]))
            return 0;
        gs4i_block_coordinates(&sim->grid, block[i], at);
        for (a = 0; a < 3; a++)
            if (at[a] < 1 || at[a] > sim->grid.blocks[a] - 2) return 0;
    }
    return 1;
}

/* Particles and grid of the file into `next`, which has none yet. */
static int gs4i_rebuild(gs4_sim *next, const gs4i_head *h, const gs4i_pieces *p)
{
    gs4i_grid *g = &next->grid;
    gs4i_array a[GS4I_ARRAYS];
    int k;
    const int room =
        next->desc.max_particles > h->particles ? next->desc.max_particles : h->particles;
    if (gs4i_particles_reserve(&next->memory, &next->particles, room) != GS4_OK)
        return GS4_ERROR_MEMORY;
    g->table = (int32_t *)gs4i_alloc(&next->memory, g->table_count, sizeof *g->table);
    if (!g->table) return GS4_ERROR_MEMORY;
    if (gs4i_grid_reserve(&next->memory, g, h->active, next->particles.with_rates) != GS4_OK
        || gs4i_grid_reserve_occupied(&next->memory, g, h->occupied + 1) != GS4_OK)
        return GS4_ERROR_MEMORY;
    if (h->active) memcpy(g->block, p->at[GS4I_PIECE_BLOCKS], p->size[GS4I_PIECE_BLOCKS]);
    memcpy(g->occupied_block, p->at[GS4I_PIECE_OCCUPIED], p->size[GS4I_PIECE_OCCUPIED]);
    memcpy(g->first, p->at[GS4I_PIECE_FIRST], p->size[GS4I_PIECE_FIRST]);
    if (!gs4i_blocks_are_sound(next, h, g->occupied_block, g->first, g->block))
        return GS4_ERROR_FORMAT;
    g->active = h->active;
    g->occupied = h->occupied;
    for (k = 0; k < g->active; k++) g->table[g->block[k]] = k + 1;
    if (g->remembered) {
        memcpy(g->remembered, p->at[GS4I_PIECE_REMEMBERED], p->size[GS4I_PIECE_REMEMBERED]);
        memcpy(g->flags, p->at[GS4I_PIECE_FLAGS], p->size[GS4I_PIECE_FLAGS]);
    }
    if (!gs4i_grid_is_complete(g)) return GS4_ERROR_FORMAT;
    gs4i_grid_link(g);
    if (gs4i_after_occupy(next) != GS4_OK) return GS4_ERROR_MEMORY;
    gs4i_particle_arrays(&next->particles, a);
    for (k = 0; k < GS4I_STATE_ARRAYS; k++)
        if (a[k].wanted && h->particles)
            memcpy(*a[k].data, p->at[GS4I_PIECE_PARTICLES + k], p->size[GS4I_PIECE_PARTICLES + k]);
    next->particles.count = h->particles;
    return gs4i_state_is_sound(next, h, p) ? GS4_OK : GS4_ERROR_FORMAT;
}

/* What belongs to the blocks and particles of a simulation. */
static GS4I_COLD void gs4i_release_state(gs4_sim *sim)
{
    gs4i_memory *m = &sim->memory;
    int i;
    gs4i_particles_free(m, &sim->particles);
    gs4i_grid_free(m, &sim->grid);
    for (i = 0; i < 6; i++)
        gs4i_free(m, sim->boundary.mirrors[i], (size_t)sim->boundary.mirror_capacity[i],
                  sizeof(gs4i_mirror_pair));
    gs4i_free(m, sim->reports, (size_t)sim->report_capacity, sizeof(gs4i_report));
    gs4i_free_image_particles(m, &sim->image_particles);
    gs4i_free_conduction(m, &sim->conduction);
    gs4i_free_staggered(m, &sim->staggered);
}

/* A copy that has no particles and no nodes yet, but says what they will carry. */
static void gs4i_copy_without_state(const gs4_sim *sim, const gs4i_head *h, gs4_sim *next)
{
    const gs4i_particles *p = &sim->particles;
    const gs4i_grid *g = &sim->grid;
    int i;
    *next = *sim;
    memset(&next->particles, 0, sizeof next->particles);
    next->particles.with_rates = p->with_rates;
    next->particles.with_subgrid = p->with_subgrid;
    next->particles.with_affine = p->with_affine;
    next->particles.with_affine_before = p->with_affine_before;
    next->particles.elastic_reals = h->elastic_reals;
    next->particles.deformation_reals = h->deformation_reals;
    next->particles.with_heat = p->with_heat;
    next->particles.with_flux = p->with_flux;
    memset(&next->grid, 0, sizeof next->grid);
    memcpy(next->grid.cells, g->cells, sizeof g->cells);
    memcpy(next->grid.blocks, g->blocks, sizeof g->blocks);
    memcpy(next->grid.periodic, g->periodic, sizeof g->periodic);
    next->grid.with_deconvolution = g->with_deconvolution;
    next->grid.h = g->h;
    next->grid.inv_h = g->inv_h;
    next->grid.origin = g->origin;
    next->grid.table_count = g->table_count;
    for (i = 0; i < 6; i++) {
        next->boundary.mirrors[i] = NULL;
        next->boundary.mirror_count[i] = next->boundary.mirror_capacity[i] = 0;
    }
    next->reports = NULL;
    next->report_capacity = 0;
    memset(&next->image_particles, 0, sizeof next->image_particles);
    memset(&next->conduction, 0, sizeof next->conduction);
    memset(&next->staggered, 0, sizeof next->staggered);
    next->conduction.with_viscous_heating = sim->conduction.with_viscous_heating;
}

static void gs4i_restore_head(gs4_sim *sim, const gs4i_head *h)
{
    sim->top_speed = GS4I_C(h->top_speed);
    sim->max_mass = GS4I_C(h->max_mass);
    gs4i_set_constants(sim);
    sim->time = h->time;
    sim->last_dt = h->last_dt;
    sim->steps = h->steps;
    sim->split = h->split;
    sim->bounded = h->bounded;
    sim->next_id = h->next_id;
    sim->restart = h->restart;
    sim->needs_sort = h->needs_sort;
    sim->limits_stale = h->limits_stale;
    sim->needs_spin = h->needs_spin;
    sim->needs_check = 0;
    sim->min_mass = GS4I_C(h->min_mass);
    sim->shift = GS4I_C(h->shift);
    sim->limits = h->limits;
}

/* Make the state of the file beside the present one, and put it in its place when it is whole. */
static GS4I_COLD int gs4i_restore(gs4_sim *sim, const gs4i_head *h, const gs4i_pieces *p)
{
    gs4_sim next, old;
    int result;
    gs4i_copy_without_state(sim, h, &next);
    result = gs4i_rebuild(&next, h, p);
    if (result != GS4_OK) {
        gs4i_release_state(&next);
        return result == GS4_ERROR_MEMORY
                   ? gs4i_fail_memory(&sim->error)
                   : gs4i_fail(
                       &sim->error, GS4_ERROR_FORMAT,
                       "the checkpoint is damaged: its blocks are out of order, or it holds "
                       "numbers that no simulation has");
    }
    old = *sim;
    old.memory = next.memory; /* the count of bytes is with the new state */
    gs4i_release_state(&old);
    next.memory = old.memory;
    *sim = next;
    gs4i_restore_scene(sim, p);
    gs4i_restore_head(sim, h);
    return GS4_OK;
}

/* The rest of the file, which says that it has `size` bytes: memory grows with what there is. */
static int gs4i_read_body(gs4_sim *sim, FILE *f, size_t size, gs4i_scratch *body)
{
    size_t have = 0, more;
    for (; have < size; have += more) {
        more = have ? have : (size_t)1 << 22;
        if (more > size - have) more = size - have;
        if (!gs4i_scratch_reserve(&sim->memory, body, have + more, have))
            return gs4i_fail_memory(&sim->error);
        if (fread((unsigned char *)body->data + have, 1, more, f) != more)
            return gs4i_fail(&sim->error, ferror(f) ? GS4_ERROR_IO : GS4_ERROR_FORMAT,
                             "the checkpoint is cut off");
    }
    return GS4_OK;
}

/* The same, with its hash; then the state. */
static int gs4i_load_body(gs4_sim *sim, FILE *f, const gs4i_head *h, size_t size,
                          gs4i_scratch *body, gs4i_pieces *p)
{
    static const int order[] = { GS4I_PIECE_CONSTANTS, GS4I_PIECE_COLLIDERS, GS4I_PIECE_EMITTERS };
    static const int after[] = { GS4I_PIECE_OCCUPIED, GS4I_PIECE_FIRST, GS4I_PIECE_BLOCKS,
                                 GS4I_PIECE_REMEMBERED, GS4I_PIECE_FLAGS };
    const unsigned char *data;
    uint64_t hash, stored;
    unsigned char more;
    size_t at = 0;
    int k, sequence[GS4I_PIECES], n = 0;
    GS4I_TRY(gs4i_read_body(sim, f, size, body));
    data = (const unsigned char *)body->data;
    if (fread(&more, 1, 1, f) == 1)
        return gs4i_fail(&sim->error, GS4_ERROR_FORMAT,
                         "the checkpoint has something behind its end");
    for (k = 0; k < 3; k++) sequence[n++] = order[k];
    for (k = 0; k < GS4I_STATE_ARRAYS; k++) sequence[n++] = GS4I_PIECE_PARTICLES + k;
    for (k = 0; k < 5; k++) sequence[n++] = after[k];
    hash = gs4i_hash_bytes(0, h, sizeof *h);
    /* over the same pieces as when it was saved */
    for (k = 0; k < n; k++) {
        p->at[sequence[k]] = data + at;
        hash = gs4i_hash_bytes(hash, data + at, p->size[sequence[k]]);
        at += p->size[sequence[k]];
    }
    memcpy(&stored, data + at, sizeof stored);
    if (hash != stored)
        return gs4i_fail(&sim->error, GS4_ERROR_FORMAT,
                         "the checkpoint is damaged: its contents do not match their checksum");
    if (!gs4i_same_scene(sim, p))
        return gs4i_fail(&sim->error, GS4_ERROR_FORMAT,
                         "the checkpoint belongs to a scene with other materials, colliders or "
                         "emitters: add the same ones, in the same order, before gs4_load");
    return gs4i_restore(sim, h, p);
}

static GS4I_COLD int gs4i_load(gs4_sim *sim, const char *path)
{
    gs4i_head h;
    gs4i_pieces p;
    gs4i_scratch body = { NULL, 0 };
    FILE *f;
    int result;
    if (!path || !*path) return gs4i_fail(&sim->error, GS4_ERROR_ARGUMENT, "path is empty");
    f = fopen(path, "rb");
    if (!f)
        return gs4i_fail(&sim->error, GS4_ERROR_IO,
                         "the checkpoint could not be opened: does it exist, and may it be read?");
    if (fread(&h, 1, sizeof h, f) != sizeof h)
        result = ferror(f)
                     ? gs4i_fail(&sim->error, GS4_ERROR_IO,
                                 "the checkpoint could not be read: is its path that of a folder?")
                     : gs4i_fail(&sim->error, GS4_ERROR_FORMAT,
                                 "the checkpoint is cut off, or no checkpoint at all");
    else
        result = gs4i_check_head(sim, &h);
    if (result == GS4_OK)
        result =
            gs4i_load_body(sim, f, &h, gs4i_piece_sizes(sim, &h, &p) + sizeof(uint64_t), &body, &p);
    gs4i_free(&sim->memory, body.data, body.bytes, 1);
    fclose(f);
    return result;
}

/* ==== [[public]] every value checked, then the work =========================================== */

/* --- rules ---------------------------------------------------------------------------------------
 *
 * A rule a line: the value, what is accepted, and the sentence that says so. A check is the list
 * of the rules of one thing that crosses the interface. */

typedef enum gs4i_must {
    GS4I_FINITE,
    GS4I_POSITIVE,
    GS4I_NOT_NEGATIVE,
    GS4I_FRACTION
} gs4i_must;

/* Of one value; beyond GS4I_HUGE, or above 0 and below its inverse, it is called absurd: there
 * reciprocals and squares are not finite any more. */
static GS4I_COLD int gs4i_check(gs4i_error *e, const char *field, gs4_real value, gs4i_must must)
{
    static const char *const accepted[] = { "a finite number", "a finite number above 0",
                                            "0 or a finite number above", "a number from 0 to 1" };
    const int sane = gs4i_finite(value) && value < GS4I_HUGE && value > -GS4I_HUGE,
              tiny = !gs4i_is_zero(value) && value >= 0
                     && !(value > (must == GS4I_FRACTION ? GS4I_TINY : 1 / GS4I_HUGE));
    int good = sane;
    gs4i_text t;
    switch (must) {
    case GS4I_FINITE: break;
    case GS4I_POSITIVE: good = sane && value > 0 && !tiny; break;
    case GS4I_NOT_NEGATIVE: good = sane && value >= 0 && !tiny; break;
    case GS4I_FRACTION: good = value >= 0 && value <= 1; break;
    }
    if (good) return GS4_OK;
    t = gs4i_begin_error(e);
    gs4i_put(&t, field);
    gs4i_put(&t, " is ");
    gs4i_put_real(&t, (double)value);
    gs4i_put(&t, "; it must be ");
    gs4i_put(&t, accepted[must]);
    if (gs4i_finite(value) && !sane)
        gs4i_put(&t, " that is not absurdly large");
    else if (tiny)
        gs4i_put(&t, " that is not absurdly small");
    return gs4i_end_error(e, GS4_ERROR_ARGUMENT);
}

static GS4I_COLD int gs4i_check3(gs4i_error *e, const char *field, gs4_vec3 v)
{
    GS4I_TRY(gs4i_check(e, field, v.x, GS4I_FINITE));
    GS4I_TRY(gs4i_check(e, field, v.y, GS4I_FINITE));
    return gs4i_check(e, field, v.z, GS4I_FINITE);
}

static int gs4i_require_between(gs4i_error *e, double low, double high, const char *before,
                                double value, const char *after)
{
    return gs4i_require_value(e, value >= low && value <= high, before, value, after);
}

/* A field that has no use here: refused, never ignored. */
static int gs4i_check_absent(gs4i_error *e, const char *field, gs4_real value, const char *why)
{
    gs4i_text t;
    if (value == 0) return GS4_OK;
    t = gs4i_begin_error(e);
    gs4i_put(&t, field);
    gs4i_put(&t, " is ");
    gs4i_put_real(&t, (double)value);
    gs4i_put(&t, "; ");
    gs4i_put(&t, why);
    return gs4i_end_error(e, GS4_ERROR_ARGUMENT);
}

static int gs4i_check_id(gs4i_error *e, const char *what, int id, int count)
{
    gs4i_text t;
    if (id >= 0 && id < count) return GS4_OK;
    t = gs4i_begin_error(e);
    gs4i_put(&t, what);
    gs4i_put(&t, " ");
    gs4i_put_integer(&t, id);
    gs4i_put(&t, " does not exist; there are ");
    gs4i_put_integer(&t, count);
    gs4i_put(&t, ", numbered from 0");
    return gs4i_end_error(e, GS4_ERROR_ARGUMENT);
}

/* --- rules of shapes -------------------------------------------------------------------------- */

static int gs4i_check_box(gs4i_error *e, const gs4_shape *s)
{
    GS4I_TRY(gs4i_check3(e, "shape low corner", s->a));
    GS4I_TRY(gs4i_check3(e, "shape high corner", s->b));
    return gs4i_require(
        e, s->a.x < s->b.x && s->a.y < s->b.y && s->a.z < s->b.z,
        "shape: each coordinate of the low corner must be below that of the high corner");
}

static int gs4i_check_cylinder(gs4i_error *e, const gs4_shape *s)
{
    GS4I_TRY(gs4i_check3(e, "shape end a", s->a));
    GS4I_TRY(gs4i_check3(e, "shape end b", s->b));
    GS4I_TRY(gs4i_require(e, gs4i_length(gs4i_sub(s->b, s->a)) > 0,
                          "shape: the ends of the cylinder coincide"));
    return gs4i_check(e, "shape radius", s->radius, GS4I_POSITIVE);
}

/* Makes the normal one of unit length. */
static int gs4i_check_plane(gs4i_error *e, gs4_shape *s)
{
    gs4_real n;
    GS4I_TRY(gs4i_check3(e, "shape point", s->a));
    GS4I_TRY(gs4i_check3(e, "shape normal", s->b));
    n = gs4i_length(s->b);
    GS4I_TRY(
        gs4i_require(e, n > 0 && gs4i_finite(n), "shape: the normal of the plane has no length"));
    s->b = gs4i_scale(s->b, 1 / n);
    return GS4_OK;
}

/* A box without what of it is farther than `most` (m), which no grid reaches. */
static void gs4i_cut_box(gs4_shape *s, gs4_real most)
{
    s->a = gs4i_vec3(gs4i_max(s->a.x, -most), gs4i_max(s->a.y, -most), gs4i_max(s->a.z, -most));
    s->b = gs4i_vec3(gs4i_min(s->b.x, most), gs4i_min(s->b.y, most), gs4i_min(s->b.z, most));
}

/* Distances from shapes far out are rounded there: to a tenth of a cell at most. Boxes are cut off
 * at that, five times as far as grids reach. Of functions only the bounds are far, which lattices
 * begin at; of meshes, 1e9 samples half a cell apart. */
static int gs4i_check_reach(gs4i_error *e, double h, gs4_shape *s)
{
    const double most = s->kind == GS4_SHAPE_SDF    ? 1e9 * h
                        : s->kind == GS4_SHAPE_MESH ? 2.5e8 * h
                                                    : 0.1 * h / (double)GS4I_EPSILON;
    gs4_vec3 low = s->a, high = s->a;
    gs4_shape cut = *s;
    double from[3], to[3], reach = 0;
    int a;
    gs4i_cut_box(&cut, GS4I_C(most));
    if (s->kind == GS4_SHAPE_BOX && cut.a.x < cut.b.x && cut.a.y < cut.b.y && cut.a.z < cut.b.z) {
        *s = cut;
        return GS4_OK;
    }
    gs4i_shape_bounds(s, &low, &high);
    gs4i_to_double(low, from);
    gs4i_to_double(high, to);
    for (a = 0; a < 3; a++) reach = fmax(reach, fmax(fabs(from[a]), fabs(to[a])));
    return gs4i_require_value(
        e, reach <= most, "shape reaches to the coordinate ", reach,
        ", so far out that distances could not tell a tenth of a cell; cut it off near the grid, "
        "use gs4_plane or gs4_box, or define GS4_DOUBLE");
}

static int gs4i_check_form(gs4i_error *e, gs4i_memory *memory, gs4_shape *s)
{
    switch (s->kind) {
    case GS4_SHAPE_BOX: return gs4i_check_box(e, s);
    case GS4_SHAPE_SPHERE:
        GS4I_TRY(gs4i_check3(e, "shape centre", s->a));
        return gs4i_check(e, "shape radius", s->radius, GS4I_POSITIVE);
    case GS4_SHAPE_CYLINDER: return gs4i_check_cylinder(e, s);
    case GS4_SHAPE_PLANE: return gs4i_check_plane(e, s);
    case GS4_SHAPE_SDF:
        GS4I_TRY(gs4i_check_box(e, s));
        return gs4i_require(e, s->distance != NULL, "shape: the distance function is missing");
    case GS4_SHAPE_MESH: return gs4i_check_mesh(e, memory, s);
    case GS4_SHAPE_NONE: break;
    }
    return gs4i_require(e, 0,
                        "shape is empty: make it with gs4_box, gs4_sphere, gs4_cylinder, "
                        "gs4_plane, gs4_sdf or gs4_mesh");
}

/* All of a shape for a grid of cells of h (m). */
static GS4I_COLD int gs4i_check_shape(gs4i_error *e, gs4i_memory *memory, gs4_real h, gs4_shape *s)
{
    GS4I_TRY(gs4i_check_form(e, memory, s));
    return gs4i_check_reach(e, (double)h, s);
}

/* --- rules of descriptions -------------------------------------------------------------------- */

/* Each of three counts between `least` and `most`. */
static int gs4i_check_cells(gs4i_error *e, const int cells[3], int least, int most,
                            const char *accepted)
{
    GS4I_TRY(gs4i_require_between(e, least, most, "cells[0] is ", cells[0], accepted));
    GS4I_TRY(gs4i_require_between(e, least, most, "cells[1] is ", cells[1], accepted));
    return gs4i_require_between(e, least, most, "cells[2] is ", cells[2], accepted);
}

static GS4I_COLD int gs4i_check_cell_size(gs4i_error *e, gs4_real h)
{
    GS4I_TRY(gs4i_check(e, "cell_size", h, GS4I_POSITIVE));
    return gs4i_require_value(e, h >= GS4I_C(1e-9) && h <= GS4I_C(1e9), "cell_size is ", (double)h,
                              "; it must be from 1e-9 to 1e9");
}

static int gs4i_check_threads(gs4i_error *e, int threads, gs4_parallel_for_fn parallel_for)
{
    GS4I_TRY(
        gs4i_require_between(e, 0, 1024, "threads is ", threads, "; it must be from 0 to 1024"));
#ifdef GS4_PTHREADS
    (void)parallel_for;
    return GS4_OK;
#else
    return gs4i_require_value(
        e, threads <= 1 || parallel_for, "threads is ", threads,
        "; more than 1 needs GS4_PTHREADS defined with the implementation, or parallel_for");
#endif
}

static int gs4i_check_allocator(gs4i_error *e, const gs4_allocator *a)
{
    return gs4i_require(e, !a->alloc_fn == !a->free_fn, "allocator: both functions or neither");
}

/* What symplectic Euler has no use for. */
static int gs4i_check_euler(gs4i_error *e, const gs4_sim_desc *d)
{
    GS4I_TRY(gs4i_check_absent(e, "rho_inf", d->rho_inf,
                               "symplectic Euler has no such parameter, leave it 0"));
    GS4I_TRY(gs4i_require(e, !d->sharp_gradients,
                          "sharp_gradients: symplectic Euler has no use for them, its error is of "
                          "first order; leave it 0"));
    return gs4i_check_absent(e, "flip_decay_time", d->flip_decay_time,
                             "symplectic Euler carries an affine velocity that the grid sees whole "
                             "(APIC), leave it 0");
}

/* What the partitioned scheme has no use for, or not yet. */
static int gs4i_check_partitioned(gs4i_error *e, const gs4_sim_desc *d)
{
    GS4I_TRY(gs4i_require(e, d->integrator != GS4_INTEGRATOR_SYMPLECTIC_EULER,
                          "integrator: symplectic Euler belongs to the explicit scheme; use "
                          "GS4_INTEGRATOR_GS4 or GS4_INTEGRATOR_BACKWARD_EULER"));
    GS4I_TRY(gs4i_require(e, !d->sharp_gradients,
                          "sharp_gradients: the partitioned scheme has none, leave it 0"));
    if (d->integrator == GS4_INTEGRATOR_BACKWARD_EULER)
        GS4I_TRY(gs4i_check_absent(e, "rho_inf", d->rho_inf,
                                   "backward Euler has no such parameter, leave it 0"));
    return GS4_OK;
}

static int gs4i_check_numerics(gs4i_error *e, const gs4_sim_desc *d)
{
    GS4I_TRY(gs4i_require_between(e, GS4_EXPLICIT, GS4_PARTITIONED, "scheme is ", (int)d->scheme,
                                  "; this version has GS4_EXPLICIT and GS4_PARTITIONED"));
    GS4I_TRY(gs4i_require_between(e, GS4_INTEGRATOR_GS4, GS4_INTEGRATOR_SYMPLECTIC_EULER,
                                  "integrator is ", (int)d->integrator,
                                  "; it is none of gs4_integrator"));
    GS4I_TRY(gs4i_require(
        e, d->integrator != GS4_INTEGRATOR_BACKWARD_EULER || d->scheme != GS4_EXPLICIT,
        "integrator: backward Euler belongs to the implicit schemes; use GS4_INTEGRATOR_GS4 or "
        "GS4_INTEGRATOR_SYMPLECTIC_EULER"));
    GS4I_TRY(gs4i_check(e, "rho_inf", d->rho_inf, GS4I_FRACTION));
    GS4I_TRY(gs4i_check(e, "rho_inf_spurious", d->rho_inf_spurious, GS4I_FRACTION));
    GS4I_TRY(gs4i_require_value(e, d->rho_inf_spurious <= d->rho_inf, "rho_inf_spurious is ",
                                (double)d->rho_inf_spurious, "; it must not be above rho_inf"));
    GS4I_TRY(gs4i_require(e, d->rho_inf * d->rho_inf_spurious <= GS4I_C(0.98),
                          "rho_inf_spurious: with both rho near 1 (Crank-Nicolson) the explicit "
                          "scheme has no stable step; rho_inf * rho_inf_spurious must not be above "
                          "0.98"));
    if (d->scheme == GS4_PARTITIONED) GS4I_TRY(gs4i_check_partitioned(e, d));
    if (d->integrator == GS4_INTEGRATOR_SYMPLECTIC_EULER) GS4I_TRY(gs4i_check_euler(e, d));
    /* infinity is welcome */
    GS4I_TRY(gs4i_require_value(
        e, d->flip_decay_time > GS4I_TINY || gs4i_is_zero(d->flip_decay_time),
        "flip_decay_time is ", (double)d->flip_decay_time,
        "; it must be 0 or above by more than rounding, INFINITY for pure FLIP"));
    GS4I_TRY(gs4i_check(e, "cfl", d->cfl, GS4I_FRACTION));
    GS4I_TRY(gs4i_check(e, "max_dt", d->max_dt, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check(e, "solver_tolerance", d->solver_tolerance, GS4I_FRACTION));
    return gs4i_require_value(e, d->solver_max_iterations >= 0, "solver_max_iterations is ",
                              d->solver_max_iterations, "; it must be 0 or above");
}

static int gs4i_check_wall(gs4i_error *e, const gs4_sim_desc *d, int w)
{
    GS4I_TRY(gs4i_require_between(e, 0, GS4_WALL_PERIODIC, "walls[] holds ", (int)d->walls[w],
                                  ", which is none of gs4_wall"));
    GS4I_TRY(gs4i_require(
        e, (d->walls[w] == GS4_WALL_PERIODIC) == (d->walls[w ^ 1] == GS4_WALL_PERIODIC),
        "walls: both walls of an axis must be GS4_WALL_PERIODIC, or neither"));
    GS4I_TRY(gs4i_check(e, "wall_temperature", d->wall_temperature[w], GS4I_FINITE));
    return gs4i_require(
        e, !d->wall_is_isothermal[w] || d->walls[w] < GS4_WALL_OPEN,
        "wall_is_isothermal: an open or periodic wall has no temperature, leave it 0");
}

/* Positions must tell a fiftieth of a cell everywhere: 0.02 h is at least an ulp of the farthest
 * coordinate. */
static int gs4i_check_extent(gs4i_error *e, double origin, int cells, double h)
{
    const double farthest = fabs(origin) + cells * h;
    return gs4i_require_value(
        e, farthest <= 2e-2 * h / (double)GS4I_EPSILON, "the grid reaches to the coordinate ",
        farthest,
        " from its origin: so far out that positions could not tell a fiftieth of a cell; use an "
        "origin near 0, fewer cells, or define GS4_DOUBLE");
}

static int gs4i_check_desc(gs4i_error *e, const gs4_sim_desc *d)
{
    double blocks = 1, origin[3];
    int i;
    GS4I_TRY(gs4i_check_cells(e, d->cells, 4, 1 << 22, "; it must be from 4 to 4194304"));
    for (i = 0; i < 3; i++) blocks *= (d->cells[i] + 3) / 4 + 2;
    GS4I_TRY(gs4i_require_value(e, blocks <= 1e9, "cells[] need ", blocks,
                                " blocks of 4^3 cells, with one around; there may be 1e9, as of "
                                "3992^3 cells"));
    GS4I_TRY(gs4i_check_cell_size(e, d->cell_size));
    GS4I_TRY(gs4i_check3(e, "origin", d->origin));
    gs4i_to_double(d->origin, origin);
    for (i = 0; i < 3; i++)
        GS4I_TRY(gs4i_check_extent(e, origin[i], d->cells[i], (double)d->cell_size));
    GS4I_TRY(gs4i_check3(e, "gravity", d->gravity));
    GS4I_TRY(gs4i_check_numerics(e, d));
    for (i = 0; i < 6; i++) GS4I_TRY(gs4i_check_wall(e, d, i));
    GS4I_TRY(gs4i_require_value(
        e, gs4i_abs(d->ambient_temperature) < GS4I_HUGE, "ambient_temperature is ",
        (double)d->ambient_temperature,
        "; give a finite temperature, which viscosity laws see in a scene without heat"));
    GS4I_TRY(gs4i_require_between(e, 0, GS4I_MAX_PARTICLES, "max_particles is ", d->max_particles,
                                  "; it must be 0 (grows as needed) or up to 1073741808"));
    GS4I_TRY(gs4i_check_threads(e, d->threads, d->parallel_for));
    return gs4i_check_allocator(e, &d->allocator);
}

/* --- rules of materials ----------------------------------------------------------------------- */

/* What a material is checked against: the scene it comes into. */
typedef struct gs4i_scene {
    gs4_real cell_size, temperature; /* m; of the air */
    int is_deconvolved, has_heat;
    gs4_scheme scheme;
    const gs4i_material_constants *materials; /* that are there already */
    int count;
} gs4i_scene;

static gs4i_scene gs4i_scene_of(const gs4_sim *sim)
{
    gs4i_scene s;
    s.cell_size = sim->grid.h;
    s.temperature = sim->desc.ambient_temperature;
    s.is_deconvolved = sim->desc.sharp_gradients;
    s.has_heat = sim->particles.with_heat;
    s.scheme = sim->desc.scheme;
    s.materials = sim->constants;
    s.count = sim->material_count;
    return s;
}

#define GS4I_NO_POM_POM "only liquid GS4_POM_POM has one, leave it 0"

/* Of the non-local part of a liquid. */
static int gs4i_check_viscoelastic(gs4i_error *e, const gs4_material *m)
{
    GS4I_TRY(gs4i_require_between(e, GS4_NEWTONIAN, GS4_POM_POM, "liquid is ", (int)m->liquid,
                                  ", which is none of gs4_liquid"));
    GS4I_TRY(gs4i_check(e, "local_fraction", m->local_fraction, GS4I_FRACTION));
    if (m->liquid == GS4_NEWTONIAN)
        GS4I_TRY(gs4i_check_absent(e, "relaxation_time", m->relaxation_time,
                                   "a Newtonian liquid has none, leave it 0"));
    else {
        GS4I_TRY(gs4i_require(e, m->relaxation_time != 0,
                              "relaxation_time is 0; a viscoelastic liquid needs one above 0"));
        GS4I_TRY(gs4i_check(e, "relaxation_time", m->relaxation_time, GS4I_POSITIVE));
        GS4I_TRY(gs4i_require_value(
            e, (double)m->viscosity / (double)m->relaxation_time < (double)GS4I_HUGE,
            "relaxation_time is ", (double)m->relaxation_time,
            "; the modulus (1 - local_fraction) viscosity / relaxation_time is absurdly large"));
    }
    if (m->liquid != GS4_POM_POM) {
        GS4I_TRY(gs4i_check_absent(e, "stretch_time", m->stretch_time, GS4I_NO_POM_POM));
        GS4I_TRY(gs4i_check_absent(e, "anisotropy", m->anisotropy, GS4I_NO_POM_POM));
        return gs4i_check_absent(e, "arms", m->arms,
                                 "only liquid GS4_POM_POM has some, leave it 0");
    }
    GS4I_TRY(gs4i_check(e, "stretch_time", m->stretch_time, GS4I_POSITIVE));
    GS4I_TRY(gs4i_check(e, "anisotropy", m->anisotropy, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_require_value(
        e, m->anisotropy <= GS4I_C(1e6), "anisotropy is ", (double)m->anisotropy,
        "; it must be up to 1e6: beyond, rounding alone stretches the pom-poms"));
    GS4I_TRY(gs4i_check(e, "arms", m->arms, GS4I_POSITIVE));
    return gs4i_require_value(e, m->arms >= 1, "arms is ", (double)m->arms,
                              "; a pom-pom has 1 or more");
}

#define GS4I_NO_SOLID_PHASE "a liquid has none, leave it 0 or choose a solid"

static int gs4i_check_solid(gs4i_error *e, const gs4i_scene *scene, const gs4_material *m)
{
    GS4I_TRY(gs4i_require_between(e, GS4_NO_SOLID, GS4_FIXED_COROTATED, "solid is ", (int)m->solid,
                                  ", which is none of gs4_solid"));
    if (m->solid == GS4_NO_SOLID) {
        GS4I_TRY(gs4i_check_absent(e, "shear_modulus", m->shear_modulus, GS4I_NO_SOLID_PHASE));
        GS4I_TRY(
            gs4i_check_absent(e, "yield_compression", m->yield_compression, GS4I_NO_SOLID_PHASE));
        return gs4i_check_absent(e, "yield_stretch", m->yield_stretch, GS4I_NO_SOLID_PHASE);
    }
    GS4I_TRY(gs4i_require(e, !scene->is_deconvolved,
                          "solid: with sharp_gradients solids would lose energy at their surfaces; "
                          "leave that field of gs4_sim_desc 0 where there are solids"));
    GS4I_TRY(
        gs4i_require(e, m->shear_modulus != 0, "shear_modulus is 0; a solid needs one above 0"));
    GS4I_TRY(gs4i_check(e, "shear_modulus", m->shear_modulus, GS4I_POSITIVE));
    GS4I_TRY(gs4i_check(e, "yield_compression", m->yield_compression, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_require_value(e, m->yield_compression < 1, "yield_compression is ",
                                (double)m->yield_compression, "; it must be below 1, 0 for none"));
    GS4I_TRY(gs4i_check(e, "yield_stretch", m->yield_stretch, GS4I_NOT_NEGATIVE));
    return gs4i_require_value(e, m->liquid == GS4_NEWTONIAN || m->can_melt, "liquid is ",
                              (int)m->liquid,
                              "; a solid that does not melt has no liquid phase, use GS4_NEWTONIAN "
                              "(its viscosity damps the solid)");
}

/* In a scene without heat the viscosity at the temperature of the air must be a number at shear
 * rates from 1e-6 to 1e6 /s. */
static GS4I_COLD int gs4i_check_cross_wlf(gs4i_error *e, const gs4i_scene *scene,
                                          const gs4_material *m)
{
    static const char *const names[6] = { "cross_wlf.a",  "cross_wlf.n",  "cross_wlf.d1",
                                          "cross_wlf.a1", "cross_wlf.t1", "cross_wlf.t2" };
    const gs4_real values[6] = { m->cross_wlf.a,  m->cross_wlf.n,  m->cross_wlf.d1,
                                 m->cross_wlf.a1, m->cross_wlf.t1, m->cross_wlf.t2 };
    gs4i_material_constants l;
    int i;
    for (i = 0; i < 6 && m->viscosity_law != GS4_VISCOSITY_CROSS_WLF; i++)
        GS4I_TRY(gs4i_check_absent(
            e, "cross_wlf", values[i],
            "only viscosity_law GS4_VISCOSITY_CROSS_WLF has constants, leave it 0"));
    if (m->viscosity_law != GS4_VISCOSITY_CROSS_WLF) return GS4_OK;
    for (i = 0; i < 6; i++)
        GS4I_TRY(
            gs4i_check(e, names[i], values[i], i == 0 || i == 2 ? GS4I_NOT_NEGATIVE : GS4I_FINITE));
    if (gs4i_has_heat(m) || scene->has_heat) return GS4_OK;
    memset(&l, 0, sizeof l);
    l.is = *m;
    gs4i_set_material_constants(&l, scene->temperature);
    for (i = -6; i <= 6; i += 2) {
        const gs4_real mu = gs4i_cross_wlf(&l.is, l.temperature, GS4I_C(pow(10, i)));
        GS4I_TRY(gs4i_require_value(e, mu >= 0 && mu < GS4I_HUGE,
                                    "cross_wlf gives no finite viscosity at ambient_temperature ",
                                    (double)l.temperature,
                                    "; other constants would, or a temperature well above t2"));
    }
    return GS4_OK;
}

/* The law, and what goes with it. */
static int gs4i_check_herschel_bulkley(gs4i_error *e, const gs4_material *m)
{
    const gs4_real values[4] = { m->herschel_bulkley.yield_stress, m->herschel_bulkley.consistency,
                                 m->herschel_bulkley.index, m->herschel_bulkley.creep_rate };
    static const char *const names[4] = { "herschel_bulkley.yield_stress",
                                          "herschel_bulkley.consistency", "herschel_bulkley.index",
                                          "herschel_bulkley.creep_rate" };
    gs4i_material_constants l;
    gs4i_gradient rest;
    gs4_real mu;
    int i;
    for (i = 0; i < 4 && m->viscosity_law != GS4_VISCOSITY_HERSCHEL_BULKLEY; i++)
        GS4I_TRY(gs4i_check_absent(
            e, names[i], values[i],
            "only viscosity_law GS4_VISCOSITY_HERSCHEL_BULKLEY has one, leave it 0"));
    if (m->viscosity_law != GS4_VISCOSITY_HERSCHEL_BULKLEY) return GS4_OK;
    GS4I_TRY(gs4i_check_absent(e, "viscosity", m->viscosity,
                               "GS4_VISCOSITY_HERSCHEL_BULKLEY has herschel_bulkley.consistency in "
                               "its place, leave it 0"));
    for (i = 0; i < 4; i++)
        if (i != 2) GS4I_TRY(gs4i_check(e, names[i], values[i], GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_require_value(e, values[2] >= GS4I_C(0.1) && values[2] <= 2,
                                "herschel_bulkley.index is ", (double)values[2],
                                "; it must be from 0.1 to 2, 1 for a Bingham liquid"));
    GS4I_TRY(gs4i_require_value(
        e, values[3] > 0 || (values[0] == 0 && values[2] >= 1), "herschel_bulkley.creep_rate is ",
        (double)values[3],
        "; with a yield stress or an index below 1 it must be above 0: viscosity at rest is "
        "yield_stress / creep_rate + consistency creep_rate^(index - 1)"));
    GS4I_TRY(gs4i_require_value(
        e, values[3] == 0 || (values[3] >= GS4I_C(1e-9) && values[3] <= GS4I_C(1e9)),
        "herschel_bulkley.creep_rate is ", (double)values[3], "; it must be from 1e-9 to 1e9 1/s"));
    GS4I_TRY(gs4i_require_value(
        e, m->liquid == GS4_NEWTONIAN, "liquid is ", (int)m->liquid,
        "; a viscoelastic liquid has no modulus by GS4_VISCOSITY_HERSCHEL_BULKLEY, use "
        "GS4_NEWTONIAN or another viscosity_law"));
    GS4I_TRY(gs4i_require(e, m->solid == GS4_NO_SOLID || m->can_melt,
                          "viscosity_law: a solid that does not melt has none, its "
                          "yield_compression and yield_stretch say where it yields"));
    memset(&l, 0, sizeof l);
    memset(rest, 0, sizeof rest);
    l.is = *m;
    l.varies = GS4I_IN_LANES;
    mu = gs4i_herschel_bulkley_of(&l, rest, 0);
    return gs4i_require_value(e, mu < GS4I_HUGE, "herschel_bulkley: the viscosity at rest is ",
                              (double)mu, " Pa s, absurdly large; a higher creep_rate would do");
}

/* 0, or a number between `low` and `high`. */
static int gs4i_check_heat_range(gs4i_error *e, gs4_real value, double low, double high,
                                 const char *before, const char *after)
{
    return gs4i_require_value(e, value == 0 || (value >= GS4I_C(low) && value <= GS4I_C(high)),
                              before, (double)value, after);
}

/* Every material of a scene with heat has a heat capacity. */
static int gs4i_check_capacities(gs4i_error *e, const gs4i_scene *scene, const gs4_material *m)
{
    int i;
    GS4I_TRY(gs4i_require(
        e, m->heat_capacity > 0 || !(gs4i_has_heat(m) || scene->has_heat),
        "heat_capacity is 0; every material of a scene with heat needs one above 0, J/(kg K)"));
    for (i = 0; i < scene->count && gs4i_has_heat(m); i++)
        GS4I_TRY(gs4i_require_value(
            e, scene->materials[i].is.heat_capacity > 0, "heat_capacity of material ", i,
            " is 0; with this material the scene has heat, and every material needs one above 0"));
    return GS4_OK;
}

#define GS4I_NEVER_MELTS "only a material that can_melt has one, leave it 0"

static int gs4i_check_heat(gs4i_error *e, const gs4i_scene *scene, const gs4_material *m)
{
    GS4I_TRY(gs4i_check(e, "heat_capacity", m->heat_capacity, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check(e, "conductivity", m->conductivity, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check(e, "flux_relaxation_time", m->flux_relaxation_time, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check(e, "fourier_fraction", m->fourier_fraction, GS4I_FRACTION));
    GS4I_TRY(gs4i_check(e, "melting_temperature", m->melting_temperature, GS4I_FINITE));
    GS4I_TRY(gs4i_check(e, "latent_heat", m->latent_heat, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check_heat_range(e, m->heat_capacity, 1e-9, 1e12, "heat_capacity is ",
                                   "; it must be 0 (no heat) or from 1e-9 to 1e12 J/(kg K)"));
    GS4I_TRY(gs4i_check_heat_range(e, m->conductivity, 1e-12, 1e12, "conductivity is ",
                                   "; it must be 0 (insulating) or from 1e-12 to 1e12 W/(m K)"));
    GS4I_TRY(gs4i_check_heat_range(e, m->flux_relaxation_time, 1e-15, 1e15,
                                   "flux_relaxation_time is ",
                                   "; it must be 0 (Fourier) or from 1e-15 to 1e15 s"));
    GS4I_TRY(gs4i_check_capacities(e, scene, m));
    GS4I_TRY(gs4i_require_value(e, m->flux_relaxation_time == 0 || m->conductivity > 0,
                                "flux_relaxation_time is ", (double)m->flux_relaxation_time,
                                "; without conductivity there is no flux, leave it 0"));
    if (!m->can_melt) {
        GS4I_TRY(gs4i_check_absent(e, "latent_heat", m->latent_heat, GS4I_NEVER_MELTS));
        return gs4i_check_absent(e, "melting_temperature", m->melting_temperature,
                                 GS4I_NEVER_MELTS);
    }
    return gs4i_require_value(
        e, (double)m->latent_heat / (double)m->heat_capacity < (double)GS4I_HUGE, "latent_heat is ",
        (double)m->latent_heat, "; over heat_capacity it is absurdly large");
}

/* Mass and stiffness of a cell must be numbers that leave gs4_real some room: for sums over a
 * neighbourhood, for J^-7 at 1/16, and for nodes with an epsilon of the mass of a cell. */
static int gs4i_check_scales(gs4i_error *e, gs4_real cell_size, const gs4_material *m)
{
    const double h = (double)cell_size, volume = h * h * h, mass = (double)m->density * volume,
                 c = fmax((double)m->sound_speed, 1), huge = (double)GS4I_HUGE,
                 room = 1e-4 / (double)(GS4I_TINY * GS4I_HUGE);
    GS4I_TRY(gs4i_require_value(
        e,
        1e6 * (double)m->shear_modulus < huge && (double)m->shear_modulus * h * h * h < room * huge,
        "shear_modulus is ", (double)m->shear_modulus,
        "; with this cell_size the stiffness of a cell is beyond gs4_real; use other units, or "
        "define GS4_DOUBLE"));
    return gs4i_require_value(
        e,
        mass < huge * 1e4 && mass * c * c < room * huge
            && mass > 64 * (double)GS4I_TINY / (double)GS4I_EPSILON,
        "density is ", (double)m->density,
        "; with this cell_size and sound_speed the mass or the stiffness of a cell is beyond "
        "gs4_real; use other units, or define GS4_DOUBLE");
}

static GS4I_COLD int gs4i_check_material(gs4i_error *e, const gs4i_scene *scene,
                                         const gs4_material *m)
{
    const double K = (double)m->density * (double)m->sound_speed * (double)m->sound_speed;
    GS4I_TRY(gs4i_check(e, "density", m->density, GS4I_POSITIVE));
    GS4I_TRY(gs4i_check(e, "viscosity", m->viscosity, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check_viscoelastic(e, m));
    GS4I_TRY(gs4i_check_solid(e, scene, m));
    GS4I_TRY(gs4i_check_cross_wlf(e, scene, m));
    GS4I_TRY(gs4i_check_herschel_bulkley(e, m));
    GS4I_TRY(gs4i_require(e, m->viscosity_law != GS4_VISCOSITY_CALLBACK || m->viscosity_fn,
                          "viscosity_fn is missing; GS4_VISCOSITY_CALLBACK needs it"));
    GS4I_TRY(gs4i_require_between(e, GS4_VISCOSITY_CONSTANT, GS4_VISCOSITY_HERSCHEL_BULKLEY,
                                  "viscosity_law is ", (int)m->viscosity_law,
                                  ", which is none of gs4_viscosity_law"));
    GS4I_TRY(gs4i_check(e, "bulk_modulus", m->bulk_modulus, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check(e, "sound_speed", m->sound_speed, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_require_value(e,
                                !(m->bulk_modulus > 0 && m->sound_speed > 0)
                                    || fabs(K - (double)m->bulk_modulus) <= 1e-3 * K,
                                "bulk_modulus is ", (double)m->bulk_modulus,
                                ", which is not density * sound_speed^2; give one of the two"));
    GS4I_TRY(gs4i_check_scales(e, scene->cell_size, m));
    if (scene->scheme == GS4_EXPLICIT)
        GS4I_TRY(gs4i_check_absent(e, "incompressible", GS4I_C(m->incompressible),
                                   "the explicit scheme is weakly compressible, leave it 0"));
    else
        GS4I_TRY(gs4i_require(e, !m->incompressible || !(m->bulk_modulus > 0 || m->sound_speed > 0),
                              "incompressible: bulk_modulus and sound_speed are infinite then, "
                              "leave them 0"));
    return gs4i_check_heat(e, scene, m);
}

/* --- rules of fillings, colliders and emitters ------------------------------------------------ */

#define GS4I_NO_HEAT                                                                               \
    "no material so far conducts heat, melts or is heated by viscosity: add that material first, " \
    "or leave it 0"

/* Fills in the default spacing, half a cell. */
static GS4I_COLD int gs4i_check_fill(gs4_sim *sim, gs4_fill *f)
{
    gs4i_error *e = &sim->error;
    GS4I_TRY(gs4i_check_id(e, "fill.material", f->material, sim->material_count));
    GS4I_TRY(gs4i_check(e, "fill.spacing", f->spacing, GS4I_NOT_NEGATIVE));
    if (f->spacing == 0) f->spacing = GS4I_C(0.5) * sim->grid.h;
    GS4I_TRY(gs4i_require_value(e, f->spacing <= sim->grid.h, "fill.spacing is ",
                                (double)f->spacing,
                                "; above one cell there would be holes in the material"));
    GS4I_TRY(gs4i_require_value(e, f->spacing >= GS4I_C(0.02) * sim->grid.h, "fill.spacing is ",
                                (double)f->spacing,
                                "; below a fiftieth of a cell it is absurdly small"));
    GS4I_TRY(gs4i_check3(e, "fill.velocity", f->velocity));
    GS4I_TRY(gs4i_check3(e, "fill.angular_velocity", f->angular_velocity));
    GS4I_TRY(gs4i_check(e, "fill.temperature", f->temperature, GS4I_FINITE));
    if (!sim->particles.with_heat)
        GS4I_TRY(gs4i_check_absent(e, "fill.temperature", f->temperature, GS4I_NO_HEAT));
    return gs4i_check(e, "fill.jitter", f->jitter, GS4I_FRACTION);
}

static int gs4i_check_collider(gs4_sim *sim, gs4_collider *c)
{
    gs4i_error *e = &sim->error;
    GS4I_TRY(gs4i_check_shape(e, &sim->memory, sim->grid.h, &c->shape));
    if (c->shape.kind == GS4_SHAPE_MESH)
        GS4I_TRY(gs4i_check_thickness(e, &c->shape, (double)sim->grid.h));
    GS4I_TRY(gs4i_require(e, (int)c->contact >= 0 && c->contact <= GS4_WALL_SEPARATE,
                          "contact of a collider must be stick, slip or separate"));
    GS4I_TRY(gs4i_require(e, c->contact != GS4_WALL_SEPARATE || sim->desc.scheme == GS4_EXPLICIT,
                          "contact: the partitioned scheme of this version has no separating "
                          "colliders; use stick or slip"));
    GS4I_TRY(gs4i_check(e, "friction", c->friction, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_require(e, c->friction == 0 || c->contact == GS4_WALL_SEPARATE,
                          "friction is for contact GS4_WALL_SEPARATE, leave it 0"));
    GS4I_TRY(gs4i_check3(e, "velocity", c->velocity));
    GS4I_TRY(gs4i_check3(e, "angular_velocity", c->angular_velocity));
    GS4I_TRY(gs4i_check3(e, "pivot", c->pivot));
    return gs4i_check(e, "temperature", c->temperature, GS4I_FINITE);
}

static int gs4i_check_emitter(gs4_sim *sim, gs4_emitter *m)
{
    gs4i_error *e = &sim->error;
    GS4I_TRY(gs4i_check_shape(e, &sim->memory, sim->grid.h, &m->shape));
    GS4I_TRY(gs4i_require(e, m->shape.kind != GS4_SHAPE_PLANE,
                          "shape: a plane has no volume to emit from"));
    GS4I_TRY(gs4i_check_fill(sim, &m->fill));
    GS4I_TRY(gs4i_require(e, !(gs4i_length(m->fill.angular_velocity) > 0),
                          "fill.angular_velocity: an emitter does not spin, leave it 0"));
    GS4I_TRY(gs4i_check3(e, "travel", m->travel));
    GS4I_TRY(gs4i_check3(e, "pivot", m->pivot));
    GS4I_TRY(gs4i_check(e, "start", m->start, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check(e, "stop", m->stop, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_require(e, m->stop == 0 || m->stop > m->start,
                          "stop must be later than start, or 0 for never"));
    return gs4i_require(e, gs4i_meets_domain(&sim->grid, &m->shape),
                        "shape lies outside of the grid");
}

/* --- life ------------------------------------------------------------------------------------- */

#if defined(__cplusplus)
#define GS4I_THREAD_LOCAL thread_local
#elif defined(__TINYC__)
#define GS4I_THREAD_LOCAL
#elif defined(__GNUC__)
#define GS4I_THREAD_LOCAL __thread
#elif defined(_MSC_VER)
#define GS4I_THREAD_LOCAL __declspec(thread)
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L
#define GS4I_THREAD_LOCAL _Thread_local
#else
#define GS4I_THREAD_LOCAL
#endif
/* The one thing outside of simulations: why the last call without one failed on this thread. */
static GS4I_THREAD_LOCAL char gs4i_last_error[sizeof((gs4i_error *)0)->text];

#define GS4I_DEFAULT_TOLERANCE (sizeof(gs4_real) == 8 ? GS4I_C(1e-6) : GS4I_C(1e-4))
#define GS4I_DEFAULT_ITERATIONS 200

static int gs4i_start_tasks(gs4i_memory *memory, gs4i_tasks *tasks, int threads,
                            gs4_parallel_for_fn parallel_for, void *user)
{
    tasks->parallel_for = parallel_for;
    tasks->user = user;
#ifdef GS4_PTHREADS
    if (threads > 1 && !parallel_for) {
        tasks->pool = gs4i_pool_create(memory, threads - 1);
        if (!tasks->pool) return GS4_ERROR_MEMORY;
    }
#else
    (void)memory;
    (void)threads;
#endif
    return GS4_OK;
}

static int gs4i_init(gs4_sim *sim)
{
    gs4i_grid *g = &sim->grid;
    const gs4_sim_desc *d = &sim->desc;
    int a;
    g->table_count = 1;
    for (a = 0; a < 3; a++) {
        g->cells[a] = d->cells[a];
        g->blocks[a] = (d->cells[a] + 3) / 4 + 2;
        g->periodic[a] = d->walls[2 * a] == GS4_WALL_PERIODIC;
        g->table_count *= (size_t)g->blocks[a];
    }
    g->with_deconvolution = d->sharp_gradients != 0;
    g->h = d->cell_size;
    g->inv_h = 1 / d->cell_size;
    g->origin = d->origin;
    sim->boundary.h = g->h;
    memcpy(sim->boundary.walls, d->walls, sizeof d->walls);
    sim->particles.with_rates = d->integrator != GS4_INTEGRATOR_SYMPLECTIC_EULER;
    sim->particles.with_affine = !sim->particles.with_rates || d->scheme != GS4_EXPLICIT;
    sim->particles.with_affine_before = d->scheme != GS4_EXPLICIT;
    sim->particles.with_subgrid =
        sim->particles.with_rates && d->scheme == GS4_EXPLICIT && gs4i_finite(d->flip_decay_time);

    sim->restart = sim->needs_sort = sim->limits_stale = 1;
    g->table = (int32_t *)gs4i_alloc(&sim->memory, g->table_count, sizeof *g->table);
    if (!g->table) {
        const double bytes = (double)g->table_count * sizeof *g->table;
        g->table_count = 0;
        return gs4i_fail_value(&sim->error, GS4_ERROR_MEMORY, "out of memory: the grid needs ",
                               bytes, " bytes for the numbers of its blocks; fewer cells would do");
    }
    if (gs4i_grid_reserve_occupied(&sim->memory, g, 1) != GS4_OK)
        return gs4i_fail_memory(&sim->error);
    if (d->max_particles
        && gs4i_particles_reserve(&sim->memory, &sim->particles, d->max_particles) != GS4_OK)
        return gs4i_fail_particles(&sim->error, &sim->particles, d->max_particles);
    if (gs4i_start_tasks(&sim->memory, &sim->tasks, d->threads, d->parallel_for, d->parallel_user)
        != GS4_OK)
        return gs4i_fail(&sim->error, GS4_ERROR_MEMORY, "the threads could not be started");
    return GS4_OK;
}

/* The hooks, or calloc and free. */
static gs4i_memory gs4i_memory_with(gs4_allocator hook)
{
    gs4i_memory memory;
    memset(&memory, 0, sizeof memory);
    memory.hook = hook;
    if (!hook.alloc_fn) {
        memory.hook.alloc_fn = gs4i_default_alloc;
        memory.hook.free_fn = gs4i_default_free;
    }
    return memory;
}

static void gs4i_set_defaults(gs4_sim_desc *d)
{
    if (d->cfl == 0) d->cfl = GS4I_C(0.5);
    if (d->solver_tolerance == 0) d->solver_tolerance = GS4I_DEFAULT_TOLERANCE;
    if (d->solver_max_iterations == 0) d->solver_max_iterations = GS4I_DEFAULT_ITERATIONS;
    if (d->threads == 0) d->threads = 1;
}

/* A simulation with nothing in it, in *out. */
static int gs4i_create(gs4i_error *e, const gs4_sim_desc *desc, gs4_sim **out)
{
    gs4i_memory memory;
    gs4_sim *sim;
    int result;
    GS4I_TRY(gs4i_require(e, desc && out,
                          "gs4_create needs a description and a place for the simulation"));
    e->log = desc->log;
    e->log_user = desc->log_user;
    GS4I_TRY(gs4i_check_desc(e, desc));
    memory = gs4i_memory_with(desc->allocator);
    sim = (gs4_sim *)gs4i_alloc(&memory, 1, sizeof *sim);
    if (!sim) return gs4i_fail_memory(e);
    sim->self = sim;
    sim->desc = *desc;
    gs4i_set_defaults(&sim->desc);
    sim->memory = memory;
    sim->error = *e;
    if (desc->log && !gs4i_finite(desc->flip_decay_time))
        desc->log(1,
                  "flip_decay_time is infinity: motion that the grid cannot see stays for ever, "
                  "which shows as noise",
                  desc->log_user);
    result = gs4i_init(sim);
    *e = sim->error;
    if (result == GS4_OK)
        *out = sim;
    else
        gs4_destroy(sim);
    return result;
}

/* The result of a call without a simulation; its sentence is kept for gs4_last_error(NULL). */
static int gs4i_tell(const gs4i_error *e, int result)
{
    if (result != GS4_OK) memcpy(gs4i_last_error, e->text, sizeof gs4i_last_error);
    return result;
}

GS4_API GS4I_COLD int gs4_create(const gs4_sim_desc *desc, gs4_sim **out)
{
    gs4i_error e;
    memset(&e, 0, sizeof e);
    if (out) *out = NULL;
    return gs4i_tell(&e, gs4i_create(&e, desc, out));
}

/* Does a callback run, which must not change the simulation? */
static int gs4i_is_busy(const gs4_sim *sim)
{
    return sim->busy || sim->error.in_log || sim->memory.in_hook;
}

GS4_API void gs4_destroy(gs4_sim *sim)
{
    gs4i_memory memory;
    int i;
    if (!sim || gs4i_is_busy(sim)) return; /* a callback of its own would go on in what is freed */
    sim->busy = 1;
#ifdef GS4_PTHREADS
    gs4i_pool_destroy(&sim->memory, sim->tasks.pool, sim->desc.threads - 1);
#endif
    gs4i_release_state(sim);
    for (i = 0; i < sim->boundary.collider_count; i++)
        gs4i_field_free(&sim->memory, &sim->boundary.colliders[i].field);
    gs4i_free(&sim->memory, sim->boundary.colliders, (size_t)sim->boundary.collider_capacity,
              sizeof(gs4i_collider));
    gs4i_free(&sim->memory, sim->constants, (size_t)sim->material_capacity,
              sizeof(gs4i_material_constants));
    gs4i_free(&sim->memory, sim->solid_phase, (size_t)sim->solid_phase_capacity,
              sizeof(gs4i_material_constants));
    gs4i_free(&sim->memory, sim->emitters, (size_t)sim->emitter_capacity, sizeof(gs4i_emitter));
    memory = sim->memory;
    gs4i_free(&memory, sim, 1, sizeof *sim);
}

GS4_API const char *gs4_last_error(const gs4_sim *sim)
{
    return sim ? sim->error.text : gs4i_last_error;
}

GS4_API gs4_sim_desc gs4_get_desc(const gs4_sim *sim)
{
    gs4_sim_desc none;
    memset(&none, 0, sizeof none);
    return sim ? sim->desc : none;
}

GS4_API int gs4_version(void) { return GS4_VERSION; }
GS4_API int gs4_real_size(void) { return (int)sizeof(gs4_real); }

GS4_API const char *gs4_result_string(int result)
{
    switch (result) {
    case GS4_OK: return "success";
    case GS4_ERROR_ARGUMENT: return "a value is out of its range";
    case GS4_ERROR_MEMORY: return "out of memory";
    case GS4_ERROR_IO: return "a file could not be opened, read or written whole";
    case GS4_ERROR_FORMAT: return "a file is damaged or not what it should be";
    case GS4_ERROR_UNSTABLE: return "the step would not be stable and was not taken";
    case GS4_ERROR_NOT_CONVERGED: return "a linear solve did not converge; the step was not taken";
    case GS4_ERROR_ABI: return "header and implementation were compiled with different settings";
    default: return result > 0 ? "success" : "unknown result";
    }
}

/* --- shapes ----------------------------------------------------------------------------------- */

static gs4_shape gs4i_shape(gs4_shape_kind kind, gs4_vec3 a, gs4_vec3 b, gs4_real radius)
{
    gs4_shape s;
    memset(&s, 0, sizeof s);
    s.kind = kind;
    s.a = a;
    s.b = b;
    s.radius = radius;
    return s;
}

GS4_API gs4_shape gs4_box(gs4_vec3 low, gs4_vec3 high)
{
    return gs4i_shape(GS4_SHAPE_BOX, low, high, 0);
}
GS4_API gs4_shape gs4_sphere(gs4_vec3 centre, gs4_real radius)
{
    return gs4i_shape(GS4_SHAPE_SPHERE, centre, centre, radius);
}
GS4_API gs4_shape gs4_cylinder(gs4_vec3 a, gs4_vec3 b, gs4_real radius)
{
    return gs4i_shape(GS4_SHAPE_CYLINDER, a, b, radius);
}
GS4_API gs4_shape gs4_plane(gs4_vec3 point, gs4_vec3 outward_normal)
{
    return gs4i_shape(GS4_SHAPE_PLANE, point, outward_normal, 0);
}

GS4_API gs4_shape gs4_sdf(gs4_sdf_fn distance, void *user, gs4_vec3 low, gs4_vec3 high)
{
    gs4_shape s = gs4i_shape(GS4_SHAPE_SDF, low, high, 0);
    s.distance = distance;
    s.user = user;
    return s;
}

GS4_API gs4_shape gs4_mesh(const gs4_real *vertices_xyz, int vertex_count, const int *triangles,
                           int triangle_count)
{
    gs4_shape s = gs4i_shape(GS4_SHAPE_MESH, gs4i_vec3(0, 0, 0), gs4i_vec3(0, 0, 0), 0);
    s.vertices = vertices_xyz;
    s.vertex_count = vertex_count;
    s.triangles = triangles;
    s.triangle_count = triangle_count;
    return s;
}

/* --- scene ------------------------------------------------------------------------------------ */

/* May this call change the simulation? Not while one of its callbacks runs. */
static int gs4i_check_idle(gs4_sim *sim)
{
    if (!sim) return GS4_ERROR_ARGUMENT;
    return gs4i_require(&sim->error, !gs4i_is_busy(sim),
                        "a callback must not change the simulation that called it: do that before "
                        "or after the call");
}

GS4_API GS4I_COLD int gs4_add_material(gs4_sim *sim, const gs4_material *material)
{
    gs4i_scene scene;
    GS4I_TRY(gs4i_check_idle(sim));
    scene = gs4i_scene_of(sim);
    GS4I_TRY(gs4i_require(&sim->error, material != NULL, "material is NULL"));
    GS4I_TRY(gs4i_check_material(&sim->error, &scene, material));
    GS4I_TRY(gs4i_require(&sim->error, sim->material_count < 256,
                          "there are 256 materials already, which is all there can be"));
    return gs4i_add_material(sim, material);
}

GS4_API GS4I_COLD int gs4_set_gravity(gs4_sim *sim, gs4_vec3 gravity)
{
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check3(&sim->error, "gravity", gravity));
    gs4i_restart(sim);
    gs4i_set_gravity(sim, gravity);
    return GS4_OK;
}

GS4_API GS4I_COLD int gs4_set_viscosity(gs4_sim *sim, int material, gs4_real viscosity)
{
    gs4i_scene scene;
    gs4_material m;
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check_id(&sim->error, "material", material, sim->material_count));
    scene = gs4i_scene_of(sim);
    m = sim->constants[material].is;
    m.viscosity = viscosity;
    if (m.viscosity_law != GS4_VISCOSITY_CROSS_WLF) memset(&m.cross_wlf, 0, sizeof m.cross_wlf);
    GS4I_TRY(gs4i_check_material(&sim->error, &scene, &m));
    sim->constants[material].is.viscosity = viscosity;
    gs4i_set_constants(sim);
    sim->limits_stale = 1;
    return GS4_OK;
}

/* After an edit by hand: the phases that temperatures say, for whoever asks first. */
static void gs4i_settle_edit(const gs4_sim *sim)
{
    const gs4i_particles *p = &sim->particles;
    int i;
    for (i = 0; i < p->count && p->with_heat && sim->needs_check; i++)
        if (gs4i_abs(p->heat[4 * (size_t)i]) < GS4I_HUGE)
            gs4i_settle_phase(p, (size_t)i, &sim->constants[p->material[i]]);
}

/* After an edit by hand: all that a user may have written, before it can do harm. */
static GS4I_COLD int gs4i_check_edit(gs4_sim *sim)
{
    const gs4i_particles *p = &sim->particles;
    int i, c;
    if (!sim->needs_check) return GS4_OK;
    for (i = 0; i < p->count; i++) {
        const gs4_real *x = p->position + 4 * (size_t)i, *v = p->velocity + 4 * (size_t)i;
        int good = gs4i_is_in_domain(&sim->grid, x);
        for (c = 0; c < 3; c++)
            good = good && gs4i_finite(x[c]) && gs4i_finite(v[c]) && v[c] < GS4I_HUGE
                   && v[c] > -GS4I_HUGE;
        if (p->with_heat) good = good && gs4i_abs(p->heat[4 * (size_t)i]) < GS4I_HUGE;
        if (!good)
            return gs4i_fail_value(
                &sim->error, GS4_ERROR_ARGUMENT, "an edit has left particle ", (double)p->id[i],
                " outside of the grid or with a number that is not finite; edit it again");
    }
    gs4i_settle_edit(sim);
    gs4i_note_speed(sim, gs4i_top_speed(p));
    sim->needs_check = 0;
    return GS4_OK;
}

GS4_API int gs4_add_particles(gs4_sim *sim, gs4_shape shape, const gs4_fill *fill)
{
    gs4_fill f;
    int result;
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_require(&sim->error, fill != NULL, "fill is NULL"));
    f = *fill;
    GS4I_TRY(gs4i_check_edit(sim));
    GS4I_TRY(gs4i_check_fill(sim, &f));
    GS4I_TRY(gs4i_check_shape(&sim->error, &sim->memory, sim->grid.h, &shape));
    gs4i_warn_of_filling(sim, &shape, &f);
    sim->busy = 1;
    result = gs4i_fill_shape(sim, &shape, &f);
    sim->busy = 0;
    return result;
}

GS4_API int gs4_remove_particles(gs4_sim *sim, gs4_shape shape)
{
    int result;
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check_edit(sim));
    GS4I_TRY(gs4i_check_shape(&sim->error, &sim->memory, sim->grid.h, &shape));
    sim->busy = 1;
    result = gs4i_empty_shape(sim, &shape);
    sim->busy = 0;
    return result;
}

/* Points in the domain, and their mean. */
static int gs4i_check_points(gs4_sim *sim, const gs4_real *xyz, int count, gs4_vec3 *mean)
{
    int i, a;
    *mean = gs4i_vec3(0, 0, 0);
    for (i = 0; i < count; i++) {
        const gs4_real *x = xyz + 3 * (size_t)i;
        for (a = 0; a < 3; a++) GS4I_TRY(gs4i_check(&sim->error, "xyz", x[a], GS4I_FINITE));
        GS4I_TRY(gs4i_require_value(&sim->error, gs4i_is_in_domain(&sim->grid, x), "point ", i,
                                    " lies outside of the grid: nothing was added"));
        *mean = gs4i_add(*mean, gs4i_scale(gs4i_vec3(x[0], x[1], x[2]), 1 / GS4I_C(count)));
    }
    return GS4_OK;
}

GS4_API int gs4_add_points(gs4_sim *sim, const gs4_real *xyz, int count, gs4_real volume_each,
                           const gs4_fill *fill)
{
    gs4i_error *e;
    gs4_fill f;
    gs4_vec3 mean;
    int result;
    GS4I_TRY(gs4i_check_idle(sim));
    e = &sim->error;
    GS4I_TRY(gs4i_require(e, fill && (xyz || count <= 0), "xyz or fill is NULL"));
    GS4I_TRY(gs4i_require_value(e, count >= 0, "count is ", count, "; it must be 0 or above"));
    f = *fill;
    GS4I_TRY(gs4i_check_edit(sim));
    GS4I_TRY(gs4i_check_fill(sim, &f));
    GS4I_TRY(gs4i_check(e, "volume_each", volume_each, GS4I_POSITIVE));
    GS4I_TRY(gs4i_require_value(e, volume_each <= 8 * sim->grid.h * sim->grid.h * sim->grid.h,
                                "volume_each is ", (double)volume_each,
                                "; above eight cells there would be holes in the material"));
    GS4I_TRY(gs4i_check_points(sim, xyz, count, &mean));
    sim->busy = 1;
    gs4i_warn_of_bodies(sim, xyz, 3, count);
    result = gs4i_add_points(sim, xyz, count, sim->constants[f.material].density * volume_each,
                             mean, &f);
    sim->busy = 0;
    return result;
}

GS4_API GS4I_COLD int gs4_add_collider(gs4_sim *sim, const gs4_collider *collider)
{
    gs4_collider c;
    int result;
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_require(&sim->error, collider != NULL, "collider is NULL"));
    c = *collider;
    GS4I_TRY(gs4i_check_collider(sim, &c));
    sim->busy = 1;
    result = gs4i_add_collider(sim, &c, 0.5 * (double)sim->grid.h);
    if (result >= 0) gs4i_warn_of_bodies(sim, sim->particles.position, 4, sim->particles.count);
    sim->busy = 0;
    return result;
}

/* The body of a collider's id, while it may be changed. */
static int gs4i_collider_of(gs4_sim *sim, int collider, gs4i_collider **body)
{
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check_id(&sim->error, "collider", collider, sim->boundary.collider_count));
    *body = &sim->boundary.colliders[collider];
    return gs4i_require(&sim->error, !(*body)->is_emitter,
                        "that id belongs to an emitter, not to a collider");
}

static int gs4i_emitter_of(gs4_sim *sim, int emitter, gs4i_collider **body)
{
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check_id(&sim->error, "emitter", emitter, sim->emitter_count));
    *body = &sim->boundary.colliders[sim->emitters[emitter].collider];
    return GS4_OK;
}

static void gs4i_set_motion(gs4_sim *sim, gs4i_collider *body, gs4_vec3 velocity,
                            gs4_vec3 angular_velocity)
{
    body->is.velocity = velocity;
    body->is.angular_velocity = angular_velocity;
    gs4i_note_speed(sim, gs4i_collider_speed(body, &sim->grid) + gs4i_length(body->flow));
    sim->limits_stale = 1;
}

GS4_API int gs4_move_collider(gs4_sim *sim, int collider, gs4_vec3 velocity,
                              gs4_vec3 angular_velocity)
{
    gs4i_collider *body;
    GS4I_TRY(gs4i_collider_of(sim, collider, &body));
    GS4I_TRY(gs4i_check3(&sim->error, "velocity", velocity));
    GS4I_TRY(gs4i_check3(&sim->error, "angular_velocity", angular_velocity));
    gs4i_set_motion(sim, body, velocity, angular_velocity);
    return GS4_OK;
}

GS4_API GS4I_COLD int gs4_add_emitter(gs4_sim *sim, const gs4_emitter *emitter)
{
    gs4_emitter e;
    int result;
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_require(&sim->error, emitter != NULL, "emitter is NULL"));
    e = *emitter;
    GS4I_TRY(gs4i_check_emitter(sim, &e));
    sim->busy = 1;
    result = gs4i_add_emitter(sim, &e);
    sim->busy = 0;
    return result;
}

GS4_API int gs4_move_emitter(gs4_sim *sim, int emitter, gs4_vec3 travel)
{
    gs4i_collider *body;
    GS4I_TRY(gs4i_emitter_of(sim, emitter, &body));
    GS4I_TRY(gs4i_check3(&sim->error, "travel", travel));
    gs4i_set_motion(sim, body, travel, gs4i_vec3(0, 0, 0));
    return GS4_OK;
}

/* --- poses ------------------------------------------------------------------------------------ */

static int gs4i_get_pose(gs4i_error *e, const gs4i_collider *body, gs4_pose *pose)
{
    int i;
    GS4I_TRY(gs4i_require(e, pose != NULL, "pose is NULL"));
    pose->position = gs4i_vec3(GS4I_C(body->at[0]), GS4I_C(body->at[1]), GS4I_C(body->at[2]));
    for (i = 0; i < 4; i++) pose->quaternion[i] = GS4I_C(body->turn[i]);
    return GS4_OK;
}

/* A pose that a user gives, with a unit quaternion. */
static int gs4i_check_pose(gs4i_error *e, const gs4_pose *pose, double at[3], double turn[4])
{
    double most = 0, norm = 0;
    int i;
    GS4I_TRY(gs4i_require(e, pose != NULL, "pose is NULL"));
    GS4I_TRY(gs4i_check3(e, "position", pose->position));
    for (i = 0; i < 4; i++) {
        GS4I_TRY(gs4i_check(e, "quaternion", pose->quaternion[i], GS4I_FINITE));
        most = fmax(most, fabs((double)pose->quaternion[i]));
    }
    gs4i_to_double(pose->position, at);
    for (i = 0; i < 4; i++) {
        turn[i] = most > 0 ? (double)pose->quaternion[i] / most : i == 0;
        norm += turn[i] * turn[i];
    }
    for (i = 0; i < 4; i++) turn[i] /= sqrt(norm);
    return GS4_OK;
}

static int gs4i_put_at(gs4_sim *sim, gs4i_collider *body, const gs4_pose *pose)
{
    double at[3], turn[4];
    GS4I_TRY(gs4i_check_pose(&sim->error, pose, at, turn));
    memcpy(body->at, at, sizeof at);
    memcpy(body->turn, turn, sizeof turn);
    gs4i_collider_orient(body);
    sim->limits_stale = 1;
    return GS4_OK;
}

/* The velocities that bring a body to a pose in the time `duration`. */
static int gs4i_move_to(gs4_sim *sim, gs4i_collider *body, const gs4_pose *pose, gs4_real duration)
{
    const double *t = body->turn;
    double at[3], q[4], by[4], half, sine, rate;
    gs4_vec3 velocity, angular;
    GS4I_TRY(gs4i_check_pose(&sim->error, pose, at, q));
    GS4I_TRY(gs4i_check(&sim->error, "duration", duration, GS4I_POSITIVE));
    /* by = q t*, the turn that is left */
    by[0] = q[0] * t[0] + q[1] * t[1] + q[2] * t[2] + q[3] * t[3];
    by[1] = -q[0] * t[1] + q[1] * t[0] - q[2] * t[3] + q[3] * t[2];
    by[2] = -q[0] * t[2] + q[1] * t[3] + q[2] * t[0] - q[3] * t[1];
    by[3] = -q[0] * t[3] - q[1] * t[2] + q[2] * t[1] + q[3] * t[0];
    sine = sqrt(by[1] * by[1] + by[2] * by[2] + by[3] * by[3]);
    half = atan2(sine, fabs(by[0]));
    rate = sine > 0 ? 2 * half / sine / (double)duration : 0;
    if (by[0] < 0) rate = -rate;
    angular = gs4i_vec3(GS4I_C(by[1] * rate), GS4I_C(by[2] * rate), GS4I_C(by[3] * rate));
    velocity = gs4i_vec3(GS4I_C((at[0] - body->at[0]) / (double)duration),
                         GS4I_C((at[1] - body->at[1]) / (double)duration),
                         GS4I_C((at[2] - body->at[2]) / (double)duration));
    GS4I_TRY(gs4i_check3(&sim->error, "velocity that this takes", velocity));
    GS4I_TRY(gs4i_check3(&sim->error, "angular velocity that this takes", angular));
    gs4i_set_motion(sim, body, velocity, angular);
    return GS4_OK;
}

GS4_API int gs4_collider_pose(gs4_sim *sim, int collider, gs4_pose *pose)
{
    gs4i_collider *body;
    GS4I_TRY(gs4i_collider_of(sim, collider, &body));
    return gs4i_get_pose(&sim->error, body, pose);
}

GS4_API int gs4_put_collider(gs4_sim *sim, int collider, const gs4_pose *pose)
{
    gs4i_collider *body;
    GS4I_TRY(gs4i_collider_of(sim, collider, &body));
    return gs4i_put_at(sim, body, pose);
}

GS4_API int gs4_move_collider_to(gs4_sim *sim, int collider, const gs4_pose *pose,
                                 gs4_real duration)
{
    gs4i_collider *body;
    GS4I_TRY(gs4i_collider_of(sim, collider, &body));
    return gs4i_move_to(sim, body, pose, duration);
}

GS4_API int gs4_emitter_pose(gs4_sim *sim, int emitter, gs4_pose *pose)
{
    gs4i_collider *body;
    GS4I_TRY(gs4i_emitter_of(sim, emitter, &body));
    return gs4i_get_pose(&sim->error, body, pose);
}

GS4_API int gs4_put_emitter(gs4_sim *sim, int emitter, const gs4_pose *pose)
{
    gs4i_collider *body;
    GS4I_TRY(gs4i_emitter_of(sim, emitter, &body));
    return gs4i_put_at(sim, body, pose);
}

GS4_API int gs4_move_emitter_to(gs4_sim *sim, int emitter, const gs4_pose *pose, gs4_real duration)
{
    gs4i_collider *body;
    GS4I_TRY(gs4i_emitter_of(sim, emitter, &body));
    return gs4i_move_to(sim, body, pose, duration);
}

/* --- stepping --------------------------------------------------------------------------------- */

/* A material whose bulk modulus is below the pressure that the densest one has when it has fallen
 * or flows: it gives way to less than 3/4 of its volume, and flies apart where it gets free. */
static void gs4i_warn_of_soft(gs4_sim *sim)
{
    const double densest = gs4i_extreme_density(sim, 1);
    gs4_material any;
    double c0;
    int i;
    memset(&any, 0, sizeof any);
    any.density = GS4I_C(densest);
    c0 = gs4i_sound_speed_of(&sim->desc, &any, sim->top_speed, densest);
    for (i = 0; i < sim->material_count; i++) {
        const gs4i_material_constants *l = &sim->constants[i];
        const double rho = (double)l->density, c = (double)l->sound_speed;
        if (rho < densest && rho * c * c < densest * c0 * c0 / 100)
            gs4i_warn_value(sim, GS4I_WARN_SOFT,
                            "a material is too soft to bear the densest one, which will press it "
                            "to a part of its volume: a bulk_modulus of ",
                            densest * c0 * c0, " Pa, or none, would do");
    }
}

/* Largest stable dt of the present state, s, and the extremes `r` that set it. What an edit by hand
 * has brought is seen, but left to the next call that checks it. */
static int gs4i_limit_now(gs4_sim *sim, gs4i_report *r, gs4_real *limit)
{
    const int busy = sim->busy;
    gs4_real top_speed = sim->top_speed;
    *limit = 0;
    GS4I_TRY(gs4i_require(&sim->error, !sim->asks,
                          "gs4_stable_dt is asked by a viscosity callback that it asks itself"));
    sim->busy = sim->asks = 1;
    *r = sim->limits;
    if (sim->needs_check) top_speed = gs4i_max(top_speed, gs4i_top_speed(&sim->particles));
    if (sim->limits_stale) gs4i_find_limits(sim, top_speed, r);
    if (!r->bad) *limit = gs4i_stable_dt(sim, r);
    sim->busy = busy;
    sim->asks = 0;
    return r->bad ? gs4i_fail_bad(sim, r) : GS4_OK;
}

GS4_API gs4_real gs4_stable_dt(const gs4_sim *sim)
{
    gs4i_report r;
    gs4_real limit = 0;
    if (sim) gs4i_limit_now(sim->self, &r, &limit);
    return limit;
}

static int gs4i_try_step(gs4_sim *sim, gs4_real dt)
{
    gs4i_report r;
    gs4_real limit;
    int result;
    GS4I_TRY(gs4i_check(&sim->error, "dt", dt, GS4I_POSITIVE));
    GS4I_TRY(gs4i_check_edit(sim));
    GS4I_TRY(gs4i_limit_now(sim, &r, &limit));
    if (dt > limit * (1 + 8 * GS4I_EPSILON)) {
        gs4i_text t = gs4i_begin_error(&sim->error);
        gs4i_put(&t, "dt is ");
        gs4i_put_real(&t, (double)dt);
        gs4i_put(&t, " s; the largest stable step is now ");
        gs4i_put_real(&t, (double)limit);
        gs4i_put(&t, " s (gs4_stable_dt); the step was not taken");
        return gs4i_end_error(&sim->error, GS4_ERROR_UNSTABLE);
    }
    /* not before: a refused call changes nothing, and a law may say something else next time */
    sim->limits = r;
    if (sim->limits_stale) gs4i_warn_of_soft(sim);
    sim->limits_stale = 0;
    if (limit < GS4I_C(1e-6))
        gs4i_warn_value(sim, GS4I_WARN_SHORT_STEPS, "the stable step is ", (double)limit,
                        " s: a second of the scene takes more than a million steps; less "
                        "viscosity, stiffness, sound_speed or speed, or larger cells, would do");
    sim->busy = 1;
    result = gs4i_step(sim, dt);
    sim->busy = 0;
    return result;
}

GS4_API int gs4_step(gs4_sim *sim, gs4_real dt)
{
    GS4I_TRY(gs4i_check_idle(sim));
    return gs4i_try_step(sim, dt);
}

#define GS4I_MAX_STEPS 1e8 /* of one gs4_advance: beyond, it would seem to hang */

/* What part of a refused step to try: half, or as much as is stable by what it saw. Liquids that
 * thicken have little to say at rest. */
static double gs4i_less(const gs4_sim *sim)
{
    const double part = (double)sim->stage_limit / (double)sim->integrator.dt;
    return part > 0 && part < 0.5 ? part : 0.5;
}

/* A step that may be refused and tried again: that is no error, so `log` does not hear of it. */
static int gs4i_try_quietly(gs4_sim *sim, gs4_real dt)
{
    int result;
    sim->error.quiet = 1;
    result = gs4i_try_step(sim, dt);
    sim->error.quiet = 0;
    return result;
}

/* Whoever is asked must leave the simulation as it is. */
static int gs4i_goes_on(gs4_sim *sim, const gs4_budget *budget)
{
    int result;
    if (!budget->go_on) return 1;
    sim->busy = 1;
    result = budget->go_on(budget->user);
    sim->busy = 0;
    return result;
}

/* Steps until nothing of sim->time_left (s) is left, or of the budget. */
static int gs4i_advance(gs4_sim *sim, const gs4_budget *budget)
{
    double *left = &sim->time_left;
    const gs4i_error before = sim->error;
    double now = gs4i_now(sim), used = 0;
    int taken = 0;
    while (*left > 0) {
        const double began = now;
        double fraction = (double)sim->desc.cfl, dt, steps;
        int tries, result = GS4_OK;
        /* a refused step is tried again, shorter */
        for (tries = 0; tries < 8; tries++, fraction *= gs4i_less(sim)) {
            gs4i_report r;
            gs4_real limit;
            GS4I_TRY(gs4i_limit_now(sim, &r, &limit));
            dt = fraction * (double)limit;
            if (sim->desc.max_dt > 0 && dt > (double)sim->desc.max_dt)
                dt = (double)sim->desc.max_dt;
            steps = ceil(*left / dt * (1 - 1e-9));
            if (!(steps < GS4I_MAX_STEPS))
                return gs4i_fail_value(
                    &sim->error, GS4_ERROR_UNSTABLE, "the stable step is ", dt,
                    " s, so short that the rest would take more than 1e8 steps; a larger "
                    "cell_size, or less viscosity, sound_speed or speed, would do");
            dt = *left / steps;
            result = gs4i_try_quietly(sim, GS4I_C(dt));
            if (result != GS4_ERROR_UNSTABLE) break;
        }
        if (result != GS4_OK) return gs4i_end_error(&sim->error, result);
        if (tries) sim->error = before;
        *left = steps <= 1 ? 0 : *left - sim->last_dt;
        now = gs4i_now(sim);
        used += gs4i_elapsed(began, now);
        taken++;
        if ((budget->steps > 0 && taken >= budget->steps)
            /* a clock that gives no number ends it */
            || (budget->seconds > 0 && !(used + (now - began) <= budget->seconds))
            || !gs4i_goes_on(sim, budget))
            break;
    }
    return GS4_OK;
}

static int gs4i_check_budget(gs4_sim *sim, const gs4_budget *b)
{
    gs4i_error *e = &sim->error;
    GS4I_TRY(gs4i_require(e, b != NULL, "budget is NULL"));
    GS4I_TRY(gs4i_require_value(e, b->steps >= 0, "budget.steps is ", b->steps,
                                "; it must be 0 (any number) or above"));
    GS4I_TRY(gs4i_require_value(e, b->seconds >= 0 && b->seconds <= (double)GS4I_HUGE,
                                "budget.seconds is ", b->seconds,
                                "; it must be 0 (any time) or a finite number above"));
    return gs4i_require(e, !(b->seconds > 0) || sim->desc.now,
                        "budget.seconds needs a clock: `now` of the description is NULL");
}

GS4_API int gs4_advance_within(gs4_sim *sim, gs4_real duration, const gs4_budget *budget,
                               double *done)
{
    uint64_t before;
    size_t used;
    gs4i_text t;
    int result;
    if (done) *done = 0;
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check(&sim->error, "duration", duration, GS4I_NOT_NEGATIVE));
    GS4I_TRY(gs4i_check_budget(sim, budget));
    GS4I_TRY(gs4i_check_edit(sim));
    before = sim->steps;
    sim->time_left = (double)duration;
    result = gs4i_advance(sim, budget);
    if (done) *done = (double)duration - sim->time_left;
    if (result == GS4_OK || sim->steps == before) return result;
    /* what it did nevertheless */
    used = strlen(sim->error.text);
    t = gs4i_text_into(sim->error.text + used, sizeof sim->error.text - used);
    gs4i_put(&t, "; before it gs4_advance took ");
    gs4i_put_integer(&t, (int64_t)(sim->steps - before));
    gs4i_put(&t, " steps, and ");
    gs4i_put_real(&t, sim->time_left);
    gs4i_put(&t, " s are left");
    return result;
}

GS4_API int gs4_advance(gs4_sim *sim, gs4_real duration)
{
    const gs4_budget unlimited = { 0, 0, NULL, NULL };
    return gs4_advance_within(sim, duration, &unlimited, NULL);
}

/* --- looking ---------------------------------------------------------------------------------- */

static gs4_real *gs4i_field_data(const gs4_sim *sim, gs4_field field, int *components)
{
    *components = 1;
    if (!sim || sim->particles.count == 0) return NULL;
    switch (field) {
    case GS4_FIELD_POSITION: *components = 3; return sim->particles.position;
    case GS4_FIELD_VELOCITY: *components = 3; return sim->particles.velocity;
    case GS4_FIELD_VOLUME_RATIO: return sim->particles.velocity + 3;
    case GS4_FIELD_MASS: return sim->particles.position + 3;
    case GS4_FIELD_STRESS:
        *components = 6;
        return sim->particles.elastic_reals ? sim->particles.elastic : NULL;
    case GS4_FIELD_DEFORMATION:
        *components = 9;
        return sim->particles.deformation_reals ? sim->particles.deformation : NULL;
    case GS4_FIELD_TEMPERATURE: return sim->particles.heat;
    case GS4_FIELD_LIQUID_FRACTION: return sim->particles.heat ? sim->particles.heat + 1 : NULL;
    case GS4_FIELD_FLUX: *components = 3; return sim->particles.flux;
    case GS4_FIELD_PRESSURE:
        return sim->desc.scheme == GS4_EXPLICIT ? NULL : sim->particles.affine[0] + 3;
    }
    return NULL;
}

GS4_API gs4_view gs4_particles(const gs4_sim *sim, gs4_field field)
{
    gs4_view v;
    int components;
    if (sim
        && (field == GS4_FIELD_LIQUID_FRACTION || field == GS4_FIELD_STRESS
            || field == GS4_FIELD_DEFORMATION))
        gs4i_settle_edit(sim);
    v.data = gs4i_field_data(sim, field, &components);
    v.count = v.data ? sim->particles.count : 0;
    v.components = v.data ? components : 0;
    v.stride = !v.data                          ? 0
               : field == GS4_FIELD_STRESS      ? sim->particles.elastic_reals
               : field == GS4_FIELD_DEFORMATION ? sim->particles.deformation_reals
                                                : 4;
    return v;
}

GS4_API gs4_edit gs4_edit_particles(gs4_sim *sim, gs4_field field)
{
    gs4_edit e;
    int components = 0;
    memset(&e, 0, sizeof e);
    if (gs4i_check_idle(sim) != GS4_OK) return e;
    e.data =
        field == GS4_FIELD_POSITION || field == GS4_FIELD_VELOCITY || field == GS4_FIELD_TEMPERATURE
            ? gs4i_field_data(sim, field, &components)
            : NULL;
    e.count = e.data ? sim->particles.count : 0;
    e.components = e.data ? components : 0;
    e.stride = e.data ? 4 : 0;
    if (!e.data)
        gs4i_fail(&sim->error, GS4_ERROR_ARGUMENT,
                  "only position, velocity and, in a scene with heat, temperature can be edited");
    if (e.data && field == GS4_FIELD_VELOCITY) {
        sim->needs_spin = 1;
        gs4i_forget_spin(sim);
    }
    if (e.data) {
        gs4i_restart(sim);
        sim->needs_check = 1;
    }
    return e;
}

GS4_API const uint32_t *gs4_particle_ids(const gs4_sim *sim)
{
    return sim ? sim->particles.id : NULL;
}
GS4_API const uint8_t *gs4_particle_materials(const gs4_sim *sim)
{
    return sim ? sim->particles.material : NULL;
}

/* --- volume by the grid ------------------------------------------------------------------------ *
 *
 * Where J has drifted from how densely particles lie, only the grid can say what they occupy. A
 * node's fill f is the volume that its material has at rest over h^3, by trilinear weights: 1 in
 * the midst, 0.5 at a flat surface. A node is inner where it and the 26 around it have f > 0.55 of
 * its own: beside a flat surface 1.05 cells or more from it, where f is 1 exactly. It occupies its
 * cell, and f says how densely. What is at a surface lies as densely as the inner nodes of its
 * block and of the 26 around: it occupies f h^3 over their mean. What has none near, spray and
 * films, occupies what it does at rest. */

#define GS4I_INNER_FILL 0.55f

/* 5^3 nodes, x fastest: those of the block and, until gs4i_occupied_share has shared them out, one
 * more at the upper end of each axis, so that a particle adds to one block alone. */
#define GS4I_OCCUPIED_SIDE 5
#define GS4I_OCCUPIED_NODES (GS4I_OCCUPIED_SIDE * GS4I_OCCUPIED_SIDE * GS4I_OCCUPIED_SIDE)

typedef struct gs4i_occupied_block {
    float f[GS4I_OCCUPIED_NODES];
    float fill, inner; /* sum of f of the inner nodes, and how many these are */
    uint8_t is_inner[GS4I_BLOCK_NODES];
} gs4i_occupied_block;

typedef struct gs4i_occupied {
    const gs4_sim *sim;
    int low[3], blocks[3]; /* the box around all that has f, from cell `low` on; in blocks */
    int64_t stride[3];
    uint32_t *place; /* per block of the box: 1 + its place; 0: nothing is there */
    gs4i_occupied_block *block;
    int count, capacity;
    size_t table;
} gs4i_occupied;

/* What cell x of an axis adds to the number of a block, and to that of a node in it. */
typedef struct gs4i_occupied_cell {
    int64_t block; /* below 0: it is beyond the box */
    int node;
} gs4i_occupied_cell;

/* Cell x of an axis, or that inside the domain whose image it is. Open walls have none. */
GS4I_INLINE int gs4i_inside_walls(const gs4_sim *sim, int axis, int x)
{
    const int n = sim->grid.cells[axis];
    const gs4_wall wall = sim->desc.walls[2 * axis + (x >= n)];
    return (x >= 0 && x < n) || wall == GS4_WALL_OPEN ? x : gs4i_mirrored(wall, x, n);
}

GS4I_INLINE gs4i_occupied_cell gs4i_occupied_cell_of(const gs4i_occupied *o, int axis, int x)
{
    static const int stride[3] = { 1, GS4I_OCCUPIED_SIDE, GS4I_OCCUPIED_SIDE * GS4I_OCCUPIED_SIDE };
    const int at = gs4i_inside_walls(o->sim, axis, x) - o->low[axis];
    gs4i_occupied_cell c;
    c.block =
        at < 0 || at >> 2 >= o->blocks[axis] ? -(int64_t)o->table : (at >> 2) * o->stride[axis];
    c.node = (at & 3) * stride[axis];
    return c;
}

/* The lower of the two nodes beside a particle along an axis, and the share of the other. */
GS4I_INLINE int gs4i_node_below(gs4_real x, gs4_real origin, gs4_real inv_h, float *share)
{
    const gs4_real at = (x - origin) * inv_h + GS4I_C(0.5); /* from -1 on */
    *share = (float)(at - GS4I_C((int)at));
    return (int)at - 1;
}

/* The box around the nodes of all particles. -1: one of them is outside of the grid. */
static int gs4i_occupied_box(gs4i_memory *memory, gs4i_occupied *o)
{
    const gs4i_grid *g = &o->sim->grid;
    const gs4i_particles *p = &o->sim->particles;
    const gs4_real origin[3] = { g->origin.x, g->origin.y, g->origin.z };
    gs4_real low[4], high[4], finite[4] = { 0, 0, 0, 0 };
    float share;
    size_t i;
    int a;
    memcpy(low, p->position, sizeof low);
    memcpy(high, p->position, sizeof high);
    for (i = 0; i < (size_t)p->count; i++) {
        const gs4_real *x = p->position + 4 * i;
        for (a = 0; a < 4; a++) {
            low[a] = gs4i_min(low[a], x[a]);
            high[a] = gs4i_max(high[a], x[a]);
            finite[a] += x[a] - x[a];
        }
    }
    if (!gs4i_is_in_domain(g, low) || !gs4i_is_in_domain(g, high)
        || !(finite[0] + finite[1] + finite[2] == 0))
        return GS4_ERROR_ARGUMENT;
    for (a = 0, o->table = 1; a < 3; a++) {
        const int from = gs4i_node_below(low[a], origin[a], g->inv_h, &share),
                  to = gs4i_node_below(high[a], origin[a], g->inv_h, &share) + 1;
        const int wraps = g->periodic[a] && (from < 0 || to >= g->cells[a]);
        o->low[a] = wraps ? -1 : from;
        o->blocks[a] = ((wraps ? g->cells[a] + 1 : to - from) >> 2) + 1;
        o->stride[a] = (int64_t)o->table;
        o->table *= (size_t)o->blocks[a];
    }
    o->place = (uint32_t *)gs4i_alloc(memory, o->table, sizeof *o->place);
    return o->place ? GS4_OK : GS4_ERROR_MEMORY;
}

/* The block, NULL: nothing is there. */
GS4I_INLINE gs4i_occupied_block *gs4i_occupied_block_at(const gs4i_occupied *o, int64_t number)
{
    return number < 0 || !o->place[number] ? NULL : o->block + o->place[number] - 1;
}

/* The block, which begins empty. NULL: there is no memory. */
GS4I_INLINE gs4i_occupied_block *gs4i_occupied_block_for(gs4i_memory *memory, gs4i_occupied *o,
                                                         int64_t number)
{
    if (!o->place[number]) {
        void *grown = gs4i_grow(memory, o->block, o->count, &o->capacity, sizeof *o->block);
        if (!grown) return NULL;
        o->block = (gs4i_occupied_block *)grown;
        o->place[number] = (uint32_t)++o->count;
    }
    return o->block + o->place[number] - 1;
}

/* All particles give to f. */
static int gs4i_occupied_add(gs4i_memory *memory, gs4i_occupied *o)
{
    const int up_y = GS4I_OCCUPIED_SIDE, up_z = up_y * GS4I_OCCUPIED_SIDE;
    const gs4i_particles *p = &o->sim->particles;
    const gs4_vec3 origin = o->sim->grid.origin;
    const gs4_real inv_h = o->sim->grid.inv_h, cells = inv_h * inv_h * inv_h;
    size_t i;
    for (i = 0; i < (size_t)p->count; i++) {
        const gs4_real *at = p->position + 4 * i;
        const float volume = (float)(at[3] * o->sim->constants[p->material[i]].inv_density * cells);
        float sx, sy, sz, low[2], high[2], *f;
        const int x = gs4i_node_below(at[0], origin.x, inv_h, &sx) - o->low[0],
                  y = gs4i_node_below(at[1], origin.y, inv_h, &sy) - o->low[1],
                  z = gs4i_node_below(at[2], origin.z, inv_h, &sz) - o->low[2];
        gs4i_occupied_block *block = gs4i_occupied_block_for(
            memory, o, (x >> 2) + (y >> 2) * o->stride[1] + (z >> 2) * o->stride[2]);
        if (!block) return GS4_ERROR_MEMORY;
        f = block->f + ((x & 3) + (y & 3) * up_y + (z & 3) * up_z);
        high[0] = volume * sz;
        low[0] = volume - high[0];
        low[1] = low[0] * sy;
        low[0] -= low[1];
        high[1] = high[0] * sy;
        high[0] -= high[1];
        f[0] += low[0] - low[0] * sx;
        f[1] += low[0] * sx;
        f[up_y] += low[1] - low[1] * sx;
        f[up_y + 1] += low[1] * sx;
        f[up_z] += high[0] - high[0] * sx;
        f[up_z + 1] += high[0] * sx;
        f[up_z + up_y] += high[1] - high[1] * sx;
        f[up_z + up_y + 1] += high[1] * sx;
    }
    return GS4_OK;
}

/* The cell where block b begins along an axis. */
GS4I_INLINE int gs4i_occupied_first(const gs4i_occupied *o, size_t b, int axis)
{
    return o->low[axis] + 4 * (int)(b / (size_t)o->stride[axis] % (size_t)o->blocks[axis]);
}

/* What block b has beyond its end or behind a wall goes to where it belongs. */
static int gs4i_occupied_share(gs4i_memory *memory, gs4i_occupied *o, size_t b)
{
    gs4i_occupied_cell cell[3][GS4I_OCCUPIED_SIDE];
    int i, a;
    if (!o->place[b]) return GS4_OK;
    for (a = 0; a < 3; a++)
        for (i = 0; i < GS4I_OCCUPIED_SIDE; i++)
            cell[a][i] = gs4i_occupied_cell_of(o, a, gs4i_occupied_first(o, b, a) + i);
    for (i = 0; i < GS4I_OCCUPIED_NODES; i++) {
        const gs4i_occupied_cell *x = &cell[0][i % GS4I_OCCUPIED_SIDE],
                                 *y = &cell[1][i / GS4I_OCCUPIED_SIDE % GS4I_OCCUPIED_SIDE],
                                 *z = &cell[2][i / (GS4I_OCCUPIED_SIDE * GS4I_OCCUPIED_SIDE)];
        const int64_t to = x->block + y->block + z->block;
        const int node = x->node + y->node + z->node;
        float *f = &o->block[o->place[b] - 1].f[i];
        const float share = *f;
        gs4i_occupied_block *block;
        if (share == 0 || (to == (int64_t)b && node == i)) continue;
        *f = 0;
        block = gs4i_occupied_block_for(memory, o, to);
        if (!block) return GS4_ERROR_MEMORY;
        block->f[node] += share;
    }
    return GS4_OK;
}

/* least[i + 4 (j + 4 k)]: the least f of node (i, j, k) of block b and of the 26 around it. */
static void gs4i_occupied_least(const gs4i_occupied *o, size_t b, float *least)
{
    gs4i_occupied_cell cell[3][6];
    float f[6 * 6 * 6];
    int i, a, stride, n;
    for (a = 0; a < 3; a++)
        for (i = 0; i < 6; i++)
            cell[a][i] = gs4i_occupied_cell_of(o, a, gs4i_occupied_first(o, b, a) + i - 1);
    for (n = 0; n < 36; n++) {
        const gs4i_occupied_cell *y = &cell[1][n % 6], *z = &cell[2][n / 6];
        for (i = 0; i < 6; i++) {
            const gs4i_occupied_block *block =
                gs4i_occupied_block_at(o, cell[0][i].block + y->block + z->block);
            f[6 * n + i] = block ? block->f[cell[0][i].node + y->node + z->node] : 0;
        }
    }
    for (stride = 1; stride <= 36; stride *= 6) /* of a node and the two after it */
        for (i = 0; i + 2 * stride < 6 * 6 * 6; i++) {
            const float next = f[i + stride] < f[i] ? f[i + stride] : f[i];
            f[i] = f[i + 2 * stride] < next ? f[i + 2 * stride] : next;
        }
    for (n = 0; n < GS4I_BLOCK_NODES; n++) least[n] = f[n % 4 + 6 * (n / 4 % 4) + 36 * (n / 16)];
}

/* Node n of a block of 4^3 among the 5^3. */
GS4I_INLINE int gs4i_occupied_node(int n)
{
    return n % 4 + GS4I_OCCUPIED_SIDE * (n / 4 % 4 + GS4I_OCCUPIED_SIDE * (n / 16));
}

/* Finds the inner nodes of block b, where anything is. What has f below 0.5 is a cloud, not a
 * liquid that has swollen. */
static void gs4i_find_inner(const gs4i_occupied *o, size_t b)
{
    gs4i_occupied_block *block = gs4i_occupied_block_at(o, (int64_t)b);
    float least[GS4I_BLOCK_NODES];
    int i;
    if (!block) return;
    gs4i_occupied_least(o, b, least);
    for (i = 0; i < GS4I_BLOCK_NODES; i++) {
        const float f = block->f[gs4i_occupied_node(i)];
        block->is_inner[i] = f > 0.5f && least[i] > GS4I_INNER_FILL * f;
        block->inner += block->is_inner[i];
        block->fill += block->is_inner[i] ? f : 0;
    }
}

/* What is in block b, in cells. */
static double gs4i_block_occupies(const gs4i_occupied *o, size_t b)
{
    const gs4i_occupied_block *block = gs4i_occupied_block_at(o, (int64_t)b);
    float fill = 0, inner = 0;
    double sum = 0;
    int i, a, at[3];
    for (i = 0; i < 27 && block; i++) {
        int64_t number = 0;
        const int d[3] = { i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1 };
        for (a = 0; a < 3; a++) {
            at[a] = (int)(b / (size_t)o->stride[a] % (size_t)o->blocks[a]) + d[a];
            number +=
                at[a] < 0 || at[a] >= o->blocks[a] ? -(int64_t)o->table : at[a] * o->stride[a];
        }
        if (gs4i_occupied_block_at(o, number)) {
            fill += gs4i_occupied_block_at(o, number)->fill;
            inner += gs4i_occupied_block_at(o, number)->inner;
        }
    }
    for (i = 0; i < GS4I_BLOCK_NODES && block; i++) {
        const float f = block->f[gs4i_occupied_node(i)];
        sum += block->is_inner[i] ? 1 : (double)(inner > 0 ? f * inner / fill : f);
    }
    return sum;
}

/* m^3; -1 where it is not known. */
static double gs4i_occupied_volume(gs4_sim *sim)
{
    const double h = (double)sim->grid.h;
    gs4i_occupied o;
    double cells = 0;
    size_t i;
    int result;
    if (!sim->particles.count) return 0;
    if (gs4i_is_busy(sim)) return -1;
    memset(&o, 0, sizeof o);
    o.sim = sim;
    result = gs4i_occupied_box(&sim->memory, &o);
    if (result == GS4_OK) result = gs4i_occupied_add(&sim->memory, &o);
    for (i = 0; i < o.table && result == GS4_OK; i++)
        result = gs4i_occupied_share(&sim->memory, &o, i);
    for (i = 0; i < o.table && result == GS4_OK; i++) gs4i_find_inner(&o, i);
    for (i = 0; i < o.table && result == GS4_OK; i++) cells += gs4i_block_occupies(&o, i);
    gs4i_free(&sim->memory, o.place, o.table, sizeof *o.place);
    gs4i_free(&sim->memory, o.block, (size_t)o.capacity, sizeof *o.block);
    return result == GS4_OK ? cells * h * h * h : -1;
}

GS4_API gs4_stats gs4_get_stats(gs4_sim *sim)
{
    gs4_stats s;
    double fastest = 0, least = 1, most = 1; /* J */
    size_t i;
    int c;
    memset(&s, 0, sizeof s);
    if (!sim) return s;
    gs4i_settle_edit(sim);
    s.time = sim->time;
    s.time_left = sim->time_left;
    s.steps = sim->steps;
    s.dt = sim->last_dt;
    s.particles = sim->particles.count;
    s.stress_substeps = sim->split;
    s.stress_bounded = sim->bounded;
    s.active_cells = sim->grid.active * GS4I_BLOCK_NODES;
    s.memory_bytes = sim->memory.bytes;
    s.heat_iterations = sim->conduction.system.iterations;
    s.solver_residual = fmax(sim->conduction.system.residual, sim->staggered.residual);
    s.pressure_iterations = sim->staggered.iterations;
    for (i = 0; i < (size_t)sim->particles.count; i++) {
        const gs4_real *at = sim->particles.position + 4 * i,
                       *moves = sim->particles.velocity + 4 * i;
        const double x[3] = { (double)at[0], (double)at[1], (double)at[2] },
                     v[3] = { (double)moves[0], (double)moves[1], (double)moves[2] },
                     m = (double)at[3], J = (double)moves[3],
                     v2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        s.mass += m;
        for (c = 0; c < 3; c++) s.momentum[c] += m * v[c];
        s.angular_momentum[0] += m * (x[1] * v[2] - x[2] * v[1]);
        s.angular_momentum[1] += m * (x[2] * v[0] - x[0] * v[2]);
        s.angular_momentum[2] += m * (x[0] * v[1] - x[1] * v[0]);
        s.kinetic_energy += 0.5 * m * v2;
        if (sim->particles.heat) {
            const gs4i_material_constants *mat = &sim->constants[sim->particles.material[i]];
            const double T = (double)sim->particles.heat[4 * i],
                         fraction = (double)sim->particles.heat[4 * i + 1];
            s.thermal_energy += m * (double)mat->capacity
                                * (T + (mat->latent > 0 ? fraction * (double)mat->latent : 0));
            if (i == 0 || T < s.min_temperature) s.min_temperature = T;
            if (i == 0 || T > s.max_temperature) s.max_temperature = T;
        }
        s.volume += m * J / (double)sim->constants[sim->particles.material[i]].density;
        if (v2 > fastest) fastest = v2;
        least = i == 0 || J < least ? J : least;
        most = i == 0 || J > most ? J : most;
    }
    s.max_speed = sqrt(fastest);
    s.min_volume_ratio = least;
    s.max_volume_ratio = most;
    s.occupied_volume = gs4i_occupied_volume(sim);
    s.seconds_total = sim->seconds[GS4I_CLOCK_TOTAL];
    s.seconds_sort = sim->seconds[GS4I_CLOCK_SORT];
    s.seconds_solve = sim->seconds[GS4I_CLOCK_SOLVE];
    /* stress is evaluated within the transfers */
    s.seconds_transfer = fmax(0, s.seconds_total - s.seconds_sort - s.seconds_solve);
    return s;
}

/* Sum over particles and nodes, so that neither their order in memory nor that of the blocks
 * matters. */
GS4_API uint64_t gs4_state_hash(const gs4_sim *sim)
{
    const gs4i_particles *p;
    uint64_t sum = 0, h;
    size_t i, n;
    int s, k;
    if (!sim) return 0;
    gs4i_settle_edit(sim);
    p = &sim->particles;
    for (i = 0; i < (size_t)p->count; i++) {
        h = gs4i_hash_bytes(gs4i_mix(p->id[i]), p->position + 4 * i, 4 * sizeof(gs4_real));
        h = gs4i_hash_bytes(h ^ p->material[i], p->velocity + 4 * i, 4 * sizeof(gs4_real));
        for (k = 0; k < 3 && p->affine[k]; k++)
            h = gs4i_hash_bytes(h, p->affine[k] + 4 * i, 3 * sizeof(gs4_real));
        for (k = 0; k < 3 && p->affine_before[k]; k++)
            h = gs4i_hash_bytes(h, p->affine_before[k] + 4 * i, 3 * sizeof(gs4_real));
        if (p->with_rates) {
            h = gs4i_hash_bytes(h, p->rate + 4 * i, 4 * sizeof(gs4_real));
            h = gs4i_hash_bytes(h, p->position_residual + 4 * i, 4 * sizeof(gs4i_half));
        }
        if (p->elastic_reals)
            h = gs4i_hash_bytes(h, p->elastic + (size_t)p->elastic_reals * i,
                                (size_t)p->elastic_reals * sizeof(gs4_real));
        if (p->deformation_reals)
            h = gs4i_hash_bytes(h, p->deformation + (size_t)p->deformation_reals * i,
                                (size_t)p->deformation_reals * sizeof(gs4_real));
        if (p->with_heat)
            h = gs4i_hash_bytes(h ^ p->liquid[i], p->heat + 4 * i, 4 * sizeof(gs4_real));
        if (p->with_flux) {
            h = gs4i_hash_bytes(h, p->flux + 4 * i, 3 * sizeof(gs4_real));
            h = gs4i_hash_bytes(h, p->flux_rate + 4 * i, 3 * sizeof(gs4_real));
        }
        sum += h;
    }
    for (s = 0; sim->grid.remembered && s < sim->grid.active; s++)
        for (n = 0; n < GS4I_BLOCK_NODES; n++) {
            const uint32_t node = gs4i_first_node(s) + (uint32_t)n;
            const int flags = sim->grid.flags[node] & GS4I_LASTS;
            gs4_real ag[4];
            if (!flags) continue;
            memcpy(ag, gs4i_of_node(sim->grid.remembered, node), sizeof ag);
            ag[3] = GS4I_C((flags & GS4I_REMEMBERS ? 1 : 0) + (flags & GS4I_WAS_PRESSED ? 2 : 0));
            sum += gs4i_hash_bytes(
                gs4i_mix(GS4I_BLOCK_NODES * (uint64_t)sim->grid.block[s] + (uint64_t)n), ag,
                sizeof ag);
        }
    for (s = 0; s < sim->boundary.collider_count; s++) {
        sum += gs4i_hash_bytes((uint64_t)s + 1, sim->boundary.colliders[s].at,
                               sizeof sim->boundary.colliders[s].at);
        sum += gs4i_hash_bytes((uint64_t)s + 2, sim->boundary.colliders[s].turn,
                               sizeof sim->boundary.colliders[s].turn);
    }
    return gs4i_hash_bytes(sum ^ (uint64_t)p->count, &sim->time, sizeof sim->time)
           ^ gs4i_mix(sim->steps);
}

/* --- files ------------------------------------------------------------------------------------ */

GS4_API int gs4_write_ply(gs4_sim *sim, const char *path)
{
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check_edit(sim));
    return gs4i_write_ply(sim, path);
}

GS4_API int gs4_write_raw(gs4_sim *sim, const char *path)
{
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check_edit(sim));
    return gs4i_write_raw(sim, path);
}

GS4_API int gs4_save(gs4_sim *sim, const char *path)
{
    GS4I_TRY(gs4i_check_idle(sim));
    GS4I_TRY(gs4i_check_edit(sim));
    return gs4i_save(sim, path);
}

GS4_API int gs4_load(gs4_sim *sim, const char *path)
{
    int result;
    GS4I_TRY(gs4i_check_idle(sim));
    sim->busy = 1; /* memory of the state that it reads has no mark of its own */
    result = gs4i_load(sim, path);
    sim->busy = 0;
    return result;
}

/* --- one material point ----------------------------------------------------------------------- */

/* A batch whose particles are all this point. */
typedef struct gs4i_point_batch {
    gs4i_batch_constants constants;
    gs4i_elastic_constants elastic;
    gs4i_solid_constants solid;
    gs4i_gradient L;
    gs4i_material_constants mat;
    gs4i_elastic e;
    gs4i_deformation d;
    gs4i_lanes J; /* of solids, and det F */
    gs4_real mu;  /* at its temperature and shear rate */
} gs4i_point_batch;

/* F of a solid point: zero means identity. Its determinant must be above 0 by more than
 * rounding. */
static int gs4i_load_point_deformation(gs4i_error *e, const gs4_real given[9], gs4i_point_batch *q)
{
    double F[3][3], U[3][3], s[3], V[3][3];
    int i, n, zero = 1;
    for (i = 0; i < 9; i++) {
        GS4I_TRY(gs4i_check(e, "deformation", given[i], GS4I_FINITE));
        zero &= given[i] == 0;
    }
    for (i = 0; i < 9; i++) F[i / 3][i % 3] = zero ? i % 4 == 0 : (double)given[i];
    gs4i_svd(F, U, s, V);
    if (!(s[2] > 4 * (double)GS4I_EPSILON * s[0]) || !(s[0] * s[0] < (double)GS4I_HUGE)
        || !(s[0] * s[1] * s[2] > 1 / (double)GS4I_HUGE))
        return gs4i_fail_value(e, GS4_ERROR_ARGUMENT, "deformation has the determinant ",
                               s[0] * s[1] * s[2],
                               "; it must be above 0 by more than rounding: neither flat nor "
                               "turned inside out (all zero: identity)");
    for (n = 0; n < GS4I_BATCH; n++) {
        for (i = 0; i < 9; i++) GS4I_NTH(q->d.F[i / 3][i % 3], n) = GS4I_C(F[i / 3][i % 3]);
        GS4I_NTH(q->J, n) = GS4I_C(s[0] * s[1] * s[2]);
    }
    return GS4_OK;
}

static int gs4i_fail_viscosity(gs4i_error *e, gs4_real mu)
{
    return gs4i_fail_value(e, GS4_ERROR_ARGUMENT,
                           "the viscosity at this temperature and shear rate is ", (double)mu,
                           "; it must be 0 or a finite number above that is not absurdly large");
}

static int gs4i_make_point_batch(gs4i_error *e, const gs4_material *material,
                                 const gs4_point *point, const gs4_real L[9], gs4i_point_batch *q)
{
    gs4i_scene alone;
    int i, n;
    memset(q, 0, sizeof *q);
    memset(&alone, 0, sizeof alone);
    GS4I_TRY(
        gs4i_require(e, material && point && L, "material, point or velocity_gradient is NULL"));
    alone.cell_size = 1;
    alone.temperature = point->temperature;
    GS4I_TRY(gs4i_check(e, "temperature", point->temperature, GS4I_FINITE));
    GS4I_TRY(gs4i_check_material(e, &alone, material));
    for (i = 0; i < 9; i++) GS4I_TRY(gs4i_check(e, "velocity_gradient", L[i], GS4I_FINITE));
    for (i = 0; i < 6; i++) {
        GS4I_TRY(gs4i_check(e, "stress", point->stress[i], GS4I_FINITE));
        GS4I_TRY(gs4i_check(e, "stress_rate", point->stress_rate[i], GS4I_FINITE));
    }
    q->mat.is = *material;
    gs4i_set_material_constants(&q->mat, point->temperature);
    if (material->can_melt && !(point->temperature > material->melting_temperature))
        gs4i_set_solid_phase(&q->mat);
    for (n = 0; n < GS4I_BATCH; n++) {
        q->constants.of[n] = &q->mat;
        GS4I_NTH(q->constants.temperature, n) = q->mat.temperature;
        for (i = 0; i < 9; i++) GS4I_NTH(q->L[i / 3][i % 3], n) = L[i];
        for (i = 0; i < 6; i++) {
            GS4I_NTH(q->e.s[i], n) = point->stress[i];
            GS4I_NTH(q->e.rate[i], n) = point->stress_rate[i];
        }
    }
    q->mu = gs4i_viscosity_of(&q->mat, point->temperature, q->L, 0);
    if (!(q->mu >= 0 && q->mu < GS4I_HUGE)) return gs4i_fail_viscosity(e, q->mu);
    gs4i_load_elastic_constants(&q->constants, &q->elastic);
    return gs4i_load_solid_constants(&q->constants, &q->solid)
               ? gs4i_load_point_deformation(e, point->deformation, q)
               : GS4_OK;
}

/* F of a point in a flow that is steady over the step: no rates are needed, and the same for
 * every member of the family. */
static int gs4i_step_solid_point(gs4i_error *e, gs4i_point_batch *q, gs4i_integrator *integrator,
                                 gs4_point *point)
{
    gs4i_solid_count count = { 0, 0, 0 };
    const double div = (double)GS4I_NTH(q->L[0][0], 0) + (double)GS4I_NTH(q->L[1][1], 0)
                       + (double)GS4I_NTH(q->L[2][2], 0);
    int i;
    for (i = 0; i < GS4I_BATCH; i++)
        GS4I_NTH(q->J, i) = GS4I_C((double)GS4I_NTH(q->J, i) * exp(div * (double)integrator->dt));
    gs4i_family(integrator, 0, 0, 1);
    gs4i_correct_solid(&q->solid, &q->d, integrator, q->L, q->J, 1, &count);
    for (i = 0; i < 9; i++)
        count.failed |= !(gs4i_abs(GS4I_NTH(q->d.F[i / 3][i % 3], 0)) < GS4I_HUGE);
    if (count.failed)
        return gs4i_fail(e, GS4_ERROR_UNSTABLE,
                         "the solid would be stretched, sheared or turned by more than a factor of "
                         "e^8 in one step; nothing has changed; a smaller dt would do");
    for (i = 0; i < 9; i++) point->deformation[i] = GS4I_NTH(q->d.F[i / 3][i % 3], 0);
    return GS4_OK;
}

/* The non-local stress of a point; rates start anew where there are none. */
static int gs4i_step_liquid_point(gs4i_error *e, gs4i_point_batch *q, gs4i_integrator *integrator,
                                  const gs4_real rho[2], gs4_point *point)
{
    gs4i_elastic_count count = { 0, 0, 0, 0, 0 };
    int i, restart = 1;
    for (i = 0; i < 6; i++) restart &= point->stress_rate[i] == 0;
    gs4i_family(integrator, rho[0], rho[1], restart);
    integrator->restart = restart;
    gs4i_correct_elastic(&q->elastic, &q->e, integrator, q->L, 1, &count);
    for (i = 0; i < 6; i++)
        count.failed |= !(gs4i_abs(GS4I_NTH(q->e.s[i], 0)) < GS4I_HUGE
                          && gs4i_abs(GS4I_NTH(q->e.rate[i], 0)) < GS4I_HUGE);
    if (count.failed)
        return gs4i_fail(e, GS4_ERROR_UNSTABLE,
                         "the non-local stress would overflow, or swings faster than it can be "
                         "followed; nothing has changed; a smaller dt would do");
    for (i = 0; i < 6; i++) {
        point->stress[i] = GS4I_NTH(q->e.s[i], 0);
        point->stress_rate[i] = GS4I_NTH(q->e.rate[i], 0);
    }
    return GS4_OK;
}

static int gs4i_point_step(gs4i_error *e, const gs4_material *material, gs4_point *point,
                           const gs4_real L[9], gs4_real dt, const gs4_real rho[2])
{
    gs4i_point_batch q;
    gs4i_integrator integrator;
    GS4I_TRY(gs4i_make_point_batch(e, material, point, L, &q));
    GS4I_TRY(gs4i_check(e, "dt", dt, GS4I_POSITIVE));
    GS4I_TRY(gs4i_check(e, "rho_inf", rho[0], GS4I_FRACTION));
    GS4I_TRY(gs4i_check(e, "rho_inf_spurious", rho[1], GS4I_FRACTION));
    GS4I_TRY(gs4i_require_value(e, rho[1] <= rho[0], "rho_inf_spurious is ", (double)rho[1],
                                ", which is more than rho_inf"));
    memset(&integrator, 0, sizeof integrator);
    integrator.dt = dt;
    if (q.mat.shear_modulus > 0) return gs4i_step_solid_point(e, &q, &integrator, point);
    return q.mat.inv_lambda > 0 ? gs4i_step_liquid_point(e, &q, &integrator, rho, point) : GS4_OK;
}

GS4_API int gs4_point_step(const gs4_material *material, gs4_point *point,
                           const gs4_real velocity_gradient[9], gs4_real dt, gs4_real rho_inf,
                           gs4_real rho_inf_spurious)
{
    const gs4_real rho[2] = { rho_inf, rho_inf_spurious };
    gs4i_error e;
    memset(&e, 0, sizeof e);
    return gs4i_tell(&e, gs4i_point_step(&e, material, point, velocity_gradient, dt, rho));
}

static int gs4i_point_stress(gs4i_error *e, const gs4_material *material, const gs4_point *point,
                             const gs4_real L[9], gs4_real cauchy[6])
{
    gs4i_point_batch q;
    gs4i_symmetric solid;
    gs4i_lanes stiffness;
    gs4_real mu;
    int i, j;
    GS4I_TRY(gs4i_make_point_batch(e, material, point, L, &q));
    GS4I_TRY(gs4i_require(e, cauchy != NULL, "cauchy is NULL"));
    mu = q.mat.local * q.mu;
    memset(solid, 0, sizeof solid);
    if (q.mat.shear_modulus > 0) gs4i_solid_stress(&q.solid, q.d.F, q.J, solid, stiffness);
    for (i = 0; i < 3; i++)
        for (j = i; j < 3; j++)
            cauchy[gs4i_place[i][j]] =
                mu * (L[3 * i + j] + L[3 * j + i])
                + (q.mat.inv_lambda > 0 ? point->stress[gs4i_place[i][j]] : 0)
                + GS4I_NTH(solid[gs4i_place[i][j]], 0);
    return GS4_OK;
}

GS4_API int gs4_point_stress(const gs4_material *material, const gs4_point *point,
                             const gs4_real velocity_gradient[9], gs4_real cauchy[6])
{
    gs4i_error e;
    memset(&e, 0, sizeof e);
    return gs4i_tell(&e, gs4i_point_stress(&e, material, point, velocity_gradient, cauchy));
}

static int gs4i_find_preset(gs4i_error *e, const char *name, gs4_material *material)
{
    gs4i_text t;
    size_t i;
    GS4I_TRY(gs4i_require(e, name && material,
                          "gs4_material_preset needs a name and a place for the material"));
    if (gs4i_preset(name, material) == GS4_OK) return GS4_OK;
    t = gs4i_begin_error(e);
    gs4i_put(&t, "there is no such preset; there are");
    for (i = 0; i < sizeof gs4i_presets / sizeof gs4i_presets[0]; i++) {
        gs4i_put(&t, i ? ", " : " ");
        gs4i_put(&t, gs4i_presets[i].name);
    }
    for (i = 0; i < sizeof gs4i_melts / sizeof gs4i_melts[0]; i++) {
        gs4i_put(&t, ", ");
        gs4i_put(&t, gs4i_melts[i].name);
    }
    for (i = 0; i < sizeof gs4i_pastes / sizeof gs4i_pastes[0]; i++) {
        gs4i_put(&t, ", ");
        gs4i_put(&t, gs4i_pastes[i].name);
    }
    return gs4i_end_error(e, GS4_ERROR_ARGUMENT);
}

GS4_API GS4I_COLD int gs4_material_preset(const char *name, gs4_material *material)
{
    gs4i_error e;
    memset(&e, 0, sizeof e);
    return gs4i_tell(&e, gs4i_find_preset(&e, name, material));
}

#if defined(__clang__)
#pragma STDC FP_CONTRACT DEFAULT
#elif defined(__GNUC__) && !defined(__TINYC__)
#pragma GCC pop_options
#endif

/* --- the elliptic solver by itself ------------------------------------------------------------ */

struct gs4_poisson {
    gs4i_memory memory;
    gs4i_tasks tasks;
    gs4_poisson_desc desc;
    gs4i_solver solver;
    double setup_seconds;
    int busy; /* a callback may be running */
};

static double gs4i_poisson_now(const gs4_poisson *p)
{
    return p->desc.now ? p->desc.now(p->desc.now_user) : 0;
}

/* All but the arrays' contents. */
static int gs4i_check_poisson(gs4i_error *e, const gs4_poisson_desc *d)
{
    const double rows = (double)d->cells[1] * d->cells[2], cells = d->cells[0] * rows;
    GS4I_TRY(gs4i_check_cells(e, d->cells, 1, 1 << 21, "; it must be from 1 to 2097152"));
    GS4I_TRY(gs4i_require(e, rows <= INT32_MAX && cells <= 16.0 * INT32_MAX,
                          "cells: more than 2^31 rows or 2^35 cells in all"));
    GS4I_TRY(gs4i_check_cell_size(e, d->cell_size));
    GS4I_TRY(gs4i_require(e, d->kind != NULL, "kind is NULL; it must be an array of gs4_cell"));
    GS4I_TRY(gs4i_check(e, "tolerance", d->tolerance, GS4I_FRACTION));
    GS4I_TRY(gs4i_require_value(e, d->max_iterations >= 0, "max_iterations is ", d->max_iterations,
                                "; it must be 0 or above"));
    GS4I_TRY(gs4i_check_threads(e, d->threads, d->parallel_for));
    return gs4i_check_allocator(e, &d->allocator);
}

static void gs4i_set_poisson_defaults(gs4_poisson_desc *d)
{
    if (d->threads == 0) d->threads = 1;
    if (d->tolerance == 0) d->tolerance = GS4I_DEFAULT_TOLERANCE;
    if (d->max_iterations == 0) d->max_iterations = GS4I_DEFAULT_ITERATIONS;
}

static int gs4i_init_poisson(gs4i_error *e, gs4_poisson *p)
{
    const gs4_poisson_desc *d = &p->desc;
    const double start = gs4i_poisson_now(p);
    int r;
    p->solver.memory = &p->memory;
    p->solver.tasks = &p->tasks;
    if (gs4i_start_tasks(&p->memory, &p->tasks, d->threads, d->parallel_for, d->parallel_user)
        != GS4_OK)
        return gs4i_fail(e, GS4_ERROR_MEMORY, "the threads could not be started");
    p->solver.returns_best = 1;
    r = gs4i_solver_setup(&p->solver, d);
    p->setup_seconds = gs4i_elapsed(start, gs4i_poisson_now(p));
    p->desc.kind = NULL;
    p->desc.diagonal = p->desc.coefficient[0] = p->desc.coefficient[1] = p->desc.coefficient[2] =
        NULL;
    if (r == GS4_OK) return GS4_OK;
    return r == GS4_ERROR_MEMORY
               ? gs4i_fail_memory(e)
               : gs4i_fail_value(e, r, p->solver.fault, p->solver.fault_value, p->solver.accepted);
}

static int gs4i_poisson_create(gs4i_error *e, const gs4_poisson_desc *desc, gs4_poisson **out)
{
    gs4_poisson *p;
    gs4i_memory memory;
    int result;
    GS4I_TRY(gs4i_require(e, desc && out,
                          "gs4_poisson_create needs a description and a place for the solver"));
    GS4I_TRY(gs4i_check_poisson(e, desc));
    memory = gs4i_memory_with(desc->allocator);
    p = (gs4_poisson *)gs4i_alloc(&memory, 1, sizeof *p);
    if (!p) return gs4i_fail_memory(e);
    p->memory = memory;
    p->desc = *desc;
    gs4i_set_poisson_defaults(&p->desc);
    result = gs4i_init_poisson(e, p);
    if (result == GS4_OK)
        *out = p;
    else
        gs4_poisson_destroy(p);
    return result;
}

GS4_API int gs4_poisson_create(const gs4_poisson_desc *desc, gs4_poisson **out)
{
    gs4i_error e;
    memset(&e, 0, sizeof e);
    if (out) *out = NULL;
    return gs4i_tell(&e, gs4i_poisson_create(&e, desc, out));
}

static int gs4i_poisson_solve(gs4i_error *e, gs4_poisson *p, const gs4_real *rhs, gs4_real *x,
                              gs4_solve_stats *stats)
{
    double start;
    int r;
    memset(stats, 0, sizeof *stats);
    GS4I_TRY(gs4i_require(e, p && rhs && x, "gs4_poisson_solve needs a solver, rhs and x"));
    GS4I_TRY(gs4i_require(e, !p->busy, "a callback must not call the solver that called it"));
    p->busy = 1;
    start = gs4i_poisson_now(p);
    r = gs4i_solver_solve(&p->solver, rhs, x, (double)p->desc.tolerance, p->desc.max_iterations,
                          stats);
    stats->setup_seconds = p->setup_seconds;
    stats->solve_seconds = gs4i_elapsed(start, gs4i_poisson_now(p));
    p->busy = 0;
    stats->memory_bytes = p->memory.bytes;
    if (r == GS4_OK) return GS4_OK;
    return gs4i_fail_value(e, r, p->solver.fault,
                           r == GS4_ERROR_ARGUMENT ? p->solver.fault_value : stats->residual,
                           p->solver.accepted);
}

GS4_API int gs4_poisson_solve(gs4_poisson *p, const gs4_real *rhs, gs4_real *x,
                              gs4_solve_stats *stats)
{
    gs4_solve_stats unread;
    gs4i_error e;
    memset(&e, 0, sizeof e);
    return gs4i_tell(&e, gs4i_poisson_solve(&e, p, rhs, x, stats ? stats : &unread));
}

GS4_API void gs4_poisson_destroy(gs4_poisson *p)
{
    gs4i_memory memory;
    if (!p || p->busy) return; /* as gs4_destroy */
    p->busy = 1;
    gs4i_solver_free(&p->solver);
#ifdef GS4_PTHREADS
    gs4i_pool_destroy(&p->memory, p->tasks.pool, p->desc.threads - 1);
#endif
    memory = p->memory;
    gs4i_free(&memory, p, 1, sizeof *p);
}

#undef GS4I_BACKSLASHES
#undef GS4I_BATCH_LOOP
#undef GS4I_BIAS
#undef GS4I_BLOCK_NODES
#undef GS4I_BLOCK_REACH
#undef GS4I_BLOCK_SIDE
#undef GS4I_BOX_PLANE
#undef GS4I_C
#undef GS4I_CHOOSE
#undef GS4I_CHOOSE_INT
#undef GS4I_CHUNK
#undef GS4I_COLD
#undef GS4I_CONDUCTS
#undef GS4I_DECONVOLVED_EIGENVALUES
#undef GS4I_DEFAULT_ITERATIONS
#undef GS4I_DEFAULT_TOLERANCE
#undef GS4I_DENSE
#undef GS4I_DESTINATION
#undef GS4I_DIFFERENCE
#undef GS4I_DIVERGENCE_BOUND
#undef GS4I_EACH
#undef GS4I_EACH_FACE
#undef GS4I_EACH_COLUMN
#undef GS4I_EPSILON
#undef GS4I_EULER_SOUND_EIGENVALUE
#undef GS4I_EULER_VISCOUS_EIGENVALUE
#undef GS4I_EXPONENT_BITS
#undef GS4I_FACE_LAYERS
#undef GS4I_FIELD_AHEAD
#undef GS4I_FIELD_BLOCK
#undef GS4I_FIELD_MARGIN
#undef GS4I_FIELD_MOST
#undef GS4I_FIELD_WHOLE
#undef GS4I_FRACTION_BITS
#undef GS4I_GRAPHS
#undef GS4I_GREATER
#undef GS4I_HUGE
#undef GS4I_IMAGE_BEND
#undef GS4I_IMAGE_NODES
#undef GS4I_IMAGE_REACH
#undef GS4I_INLINE
#undef GS4I_INNER_FILL
#undef GS4I_IS_LIQUID
#undef GS4I_IS_OPEN
#undef GS4I_J_HIGH
#undef GS4I_J_LOW
#undef GS4I_LANE
#undef GS4I_LANES
#undef GS4I_LEADER
#undef GS4I_LEAST_CONDUCTIVITY
#undef GS4I_LIGHT_NODE
#undef GS4I_LIQUID_FILL
#undef GS4I_LOAD
#undef GS4I_LONG_ROWS
#undef GS4I_LOWEST_BITS
#undef GS4I_MAD
#undef GS4I_MANY_SUBSTEPS
#undef GS4I_MAX_PARTICLES
#undef GS4I_MAX_STEPS
#undef GS4I_MIXING
#undef GS4I_MORE_SWEEPS
#undef GS4I_MOST_CORRECTION
#undef GS4I_FIT_TOLERANCE
#undef GS4I_FIT_ITERATIONS
#undef GS4I_MOST_STRAIN
#undef GS4I_MOST_STRETCH
#undef GS4I_MOST_UNPACKED
#undef GS4I_MUL
#undef GS4I_NEGLIGIBLE_FACE
#undef GS4I_NEVER_MELTS
#undef GS4I_NODES_REACH
#undef GS4I_NODE_REALS
#undef GS4I_NO_HEAT
#undef GS4I_NO_POM_POM
#undef GS4I_NO_SOLID_PHASE
#undef GS4I_NO_UNKNOWN
#undef GS4I_NTH
#undef GS4I_NTH_CONST
#undef GS4I_OCCUPIED_NODES
#undef GS4I_OCCUPIED_SIDE
#undef GS4I_PACKED
#undef GS4I_PAIRS
#undef GS4I_PREFETCH
#undef GS4I_RESTRICT
#undef GS4I_REVISIONS
#undef GS4I_ROOT_BITS
#undef GS4I_ROW_DIFFERENCE
#undef GS4I_ROW_LOAD
#undef GS4I_ROW_MAD
#undef GS4I_ROW_MUL
#undef GS4I_ROW_SPLAT_MAD
#undef GS4I_ROW_SPLAT_MUL
#undef GS4I_ROW_STORE
#undef GS4I_ROW_SUM
#undef GS4I_SAFE_STRAIN
#undef GS4I_SEEN
#undef GS4I_SLABS
#undef GS4I_SLOW_DECAY
#undef GS4I_SMALL_STEP
#undef GS4I_SOLID_WAVES
#undef GS4I_SOUND_EIGENVALUE
#undef GS4I_SPLAT_MAD
#undef GS4I_SPLAT_MUL
#undef GS4I_SPLIT_LIMIT
#undef GS4I_SPLIT_TOLERANCE
#undef GS4I_SPREAD
#undef GS4I_SQRT
#undef GS4I_STICKY_REACH
#undef GS4I_STORE
#undef GS4I_STRIP
#undef GS4I_STRONG
#undef GS4I_SUM
#undef GS4I_SURFACE_DEPTH
#undef GS4I_THREAD_LOCAL
#undef GS4I_TILE
#undef GS4I_TILE_REALS
#undef GS4I_TINY
#undef GS4I_TO_REAL
#undef GS4I_TRUNCATE
#undef GS4I_TRY
#undef GS4I_VECTORS
#undef GS4I_VISCOUS_EIGENVALUE
#undef GS4I_VISITED
#undef GS4I_WALL_MIXING
#undef GS4I_WHOLE
#undef GS4I_WHOLE_BITS
#undef GS4I_WIDE_MAX
#undef GS4I_WIDE_MIN
#undef GS4I_WIDTH

#endif /* GS4MPM_IMPLEMENTATION */

/*  MIT License
 *
 * Copyright (c) 2026 the authors of gs4mpm.h
 *
 * Permission is hereby granted, free of charge, to any person obtaining a copy of this software
 * and associated documentation files (the "Software"), to deal in the Software without
 * restriction, including without limitation the rights to use, copy, modify, merge, publish,
 * distribute, sublicense, and/or sell copies of the Software, and to permit persons to whom the
 * Software is furnished to do so, subject to the following conditions:
 *
 * The above copyright notice and this permission notice shall be included in all copies or
 * substantial portions of the Software.
 *
 * THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING
 * BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND
 * NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM,
 * DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
 * OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
 *
 * CHANGES 0.1.0  the explicit scheme: GS4 and symplectic Euler, Newtonian and viscoelastic
 * liquids, solids, walls, colliders, emitters, frames, checkpoints. Checkpoints have a byte of
 * flags a node; those written before cannot be read. The rim of a collider that turns counts in the
 * stable step and in default speeds of sound. Sticky colliders near each other hold nodes inside
 * of them alone; sub-grid velocity decays at the nodes that sticky colliders hold. They take
 * particles of liquids no farther than to the velocity that the grid sees, and where they move
 * sub-grid velocity before them decays. Distances of
 * sticky colliders are asked for at nodes, of those at rest not every step.
 * Meshes: sampled where the domain meets them, at half a cell whatever their size, before coarser
 * where they were large. Parts that overlap are a union, before the overlap was empty. Parts inside
 * out, and bodies thinner than 0.3 cells on average, are refused.
 * Heat: temperatures that the grid does not see fade as fast as heat is conducted, before no faster
 * than flip_decay_time; beside isothermal walls faster yet. Periodic boxes keep their heat, which
 * drifted by some % a step where s k/(rho c h^2) was 1e5.
 * Refused now: numbers too small for a reciprocal, callbacks that give no number, shapes too far
 * out for gs4_real, changes of a simulation by its own callbacks, checkpoints with numbers that no
 * simulation has or with other pivots, starts or stops. `log` says at level 1, once each, what is
 * allowed but hardly meant. gs4_stats has time_left and occupied_volume. gs4_stable_dt is 0
 * where a law gives no viscosity. Files follow symbolic links. Liquids that flow has packed swell
 * again (VOLUME), with GS4 and symplectic Euler.
 * Emitters: the velocity of a filling is relative to the emitter, which travels from its start on.
 * Densities: the stable step of GS4 sees heavy particles among light ones, default speeds of sound
 * the densest material. J may be up to 256, before 16.
 * New: the partitioned scheme, for liquids of any bulk modulus; checkpoints know the scheme.
 * Coulomb friction holds without a creep. New: poses, gs4_advance_within, gs4_set_gravity,
 * gs4_set_viscosity, gs4_remove_particles; Herschel-Bulkley liquids and presets of such, with which
 * gs4_material has new members: checkpoints written before cannot be read. A step that gs4_advance
 * tries again is no error: neither `log` nor gs4_last_error has it. The box around a cylinder is
 * tight, so emitters of that shape fill a little differently.
 * flip_decay_time 0, the default: noise of velocities and J after impacts decays as fast as it
 * crosses cells (NOISE); other values mean what they did. gs4_get_desc gives 0 for it, before
 * 0.5. GS4_FIELD_PRESSURE, of the partitioned scheme, in frames too; that has heat now, and steps
 * no longer than ripples of its surfaces bear; separating and periodic walls. Forces of stress at
 * its free surfaces are not lost any more: there elastic bodies gained energy, and viscous ones
 * momentum. Its sound is within 1.5 % at 20 cells a wave, before 2.5. Incompressible liquid slides
 * around slippery colliders, which braked it or, where they turned, gave it energy without end.
 * What meets a separating wall in its first step is thrown back no more. */
