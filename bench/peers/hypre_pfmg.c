/* Conjugate gradients with PFMG, the structured multigrid of HYPRE, on a poisson_case, in
 * double; cells that are not liquid are identity rows. Options: red-black Gauss-Seidel,
 * rediscretised coarse operators, skipped relaxation. Included by bench/poisson.c. */
#include <HYPRE.h>
#include <HYPRE_struct_ls.h>
#include <mpi.h>

typedef struct hypre_result {
    int iterations;
    double residual, setup, solve;
} hypre_result;

static void hypre_begin(void)
{
    int none = 0;
    char **no = NULL;
    MPI_Init(&none, &no);
    HYPRE_Init();
}
static void hypre_end(void)
{
    HYPRE_Finalize();
    MPI_Finalize();
}

/* Diagonal and faces towards +x +y +z, in `stencil` order, and the right-hand side with what
 * flows in from the air. */
static void hypre_rows(const poisson_case *p, double *values, double *b)
{
    const int *n = p->desc.cells;
    const size_t step[3] = { 1, (size_t)n[0], (size_t)n[0] * (size_t)n[1] };
    size_t at = 0;
    int i[3], a;
    for (i[2] = 0; i[2] < n[2]; i[2]++)
        for (i[1] = 0; i[1] < n[1]; i[1]++)
            for (i[0] = 0; i[0] < n[0]; i[0]++, at++) {
                double *row = values + 4 * at;
                memset(row, 0, 4 * sizeof *row);
                b[at] = 0;
                row[0] = 1;
                if (p->kind[at] != GS4_CELL_LIQUID) continue;
                poisson_row(p, i, b, &row[0], NULL);
                b[at] = (double)p->rhs[at];
                if (!(row[0] > 0)) {
                    row[0] = 1;
                    b[at] = 0;
                }
                for (a = 0; a < 3; a++) {
                    const size_t m0 = (size_t)(n[0] + (a == 0)), m1 = (size_t)(n[1] + (a == 1));
                    const size_t face =
                        (size_t)(i[0] + (a == 0))
                        + m0 * ((size_t)(i[1] + (a == 1)) + m1 * (size_t)(i[2] + (a == 2)));
                    if (i[a] + 1 < n[a] && p->kind[at + step[a]] == GS4_CELL_LIQUID)
                        row[1 + a] = -(p->coefficient[a] ? (double)p->coefficient[a][face] : 1);
                }
            }
}

static hypre_result hypre_pfmg(const poisson_case *p, double tolerance, int limit)
{
    static HYPRE_Int offsets[4][3] = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 }, { 0, 0, 1 } },
                     entries[4] = { 0, 1, 2, 3 }, ghost[6] = { 1, 1, 1, 1, 1, 1 };
    HYPRE_Int low[3] = { 0, 0, 0 },
              high[3] = { p->desc.cells[0] - 1, p->desc.cells[1] - 1, p->desc.cells[2] - 1 };
    double *values = (double *)malloc(4 * p->count * sizeof *values),
           *b = poisson_doubles(NULL, p->count), start;
    HYPRE_StructGrid grid;
    HYPRE_StructStencil stencil;
    HYPRE_StructMatrix A;
    HYPRE_StructVector rhs, x;
    HYPRE_StructSolver cg, pfmg;
    HYPRE_Int iterations;
    hypre_result r;
    int q;
    if (!values) exit(3);
    hypre_rows(p, values, b);
    poisson_take_means(p, b);
    HYPRE_StructGridCreate(MPI_COMM_WORLD, 3, &grid);
    HYPRE_StructGridSetExtents(grid, low, high);
    HYPRE_StructGridAssemble(grid);
    HYPRE_StructStencilCreate(3, 4, &stencil);
    for (q = 0; q < 4; q++) HYPRE_StructStencilSetElement(stencil, q, offsets[q]);
    HYPRE_StructMatrixCreate(MPI_COMM_WORLD, grid, stencil, &A);
    HYPRE_StructMatrixSetSymmetric(A, 1);
    HYPRE_StructMatrixSetNumGhost(A, ghost);
    HYPRE_StructMatrixInitialize(A);
    HYPRE_StructMatrixSetBoxValues(A, low, high, 4, entries, values);
    HYPRE_StructMatrixAssemble(A);
    HYPRE_StructVectorCreate(MPI_COMM_WORLD, grid, &rhs);
    HYPRE_StructVectorInitialize(rhs);
    HYPRE_StructVectorSetBoxValues(rhs, low, high, b);
    HYPRE_StructVectorAssemble(rhs);
    HYPRE_StructVectorCreate(MPI_COMM_WORLD, grid, &x);
    HYPRE_StructVectorInitialize(x);
    HYPRE_StructVectorSetConstantValues(x, 0);
    HYPRE_StructVectorAssemble(x);
    HYPRE_StructPCGCreate(MPI_COMM_WORLD, &cg);
    HYPRE_StructPCGSetTol(cg, tolerance);
    HYPRE_StructPCGSetMaxIter(cg, limit);
    HYPRE_StructPCGSetTwoNorm(cg, 1);
    HYPRE_StructPFMGCreate(MPI_COMM_WORLD, &pfmg);
    HYPRE_StructPFMGSetMaxIter(pfmg, 1);
    HYPRE_StructPFMGSetTol(pfmg, 0);
    HYPRE_StructPFMGSetZeroGuess(pfmg);
    HYPRE_StructPFMGSetRAPType(pfmg, 1);
    HYPRE_StructPFMGSetRelaxType(pfmg, 2);
    HYPRE_StructPFMGSetSkipRelax(pfmg, 1);
    HYPRE_StructPFMGSetNumPreRelax(pfmg, 1);
    HYPRE_StructPFMGSetNumPostRelax(pfmg, 1);
    HYPRE_StructPCGSetPrecond(cg, HYPRE_StructPFMGSolve, HYPRE_StructPFMGSetup, pfmg);
    start = bench_now(NULL);
    HYPRE_StructPCGSetup(cg, A, rhs, x);
    r.setup = bench_now(NULL) - start;
    start = bench_now(NULL);
    HYPRE_StructPCGSolve(cg, A, rhs, x);
    r.solve = bench_now(NULL) - start;
    HYPRE_StructPCGGetNumIterations(cg, &iterations);
    HYPRE_StructPCGGetFinalRelativeResidualNorm(cg, &r.residual);
    r.iterations = (int)iterations;
    HYPRE_ClearAllErrors();
    HYPRE_StructPFMGDestroy(pfmg);
    HYPRE_StructPCGDestroy(cg);
    HYPRE_StructVectorDestroy(x);
    HYPRE_StructVectorDestroy(rhs);
    HYPRE_StructMatrixDestroy(A);
    HYPRE_StructStencilDestroy(stencil);
    HYPRE_StructGridDestroy(grid);
    free(values);
    free(b);
    return r;
}
