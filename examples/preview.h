/* preview.h - pictures of the surface of materials for the examples: PNG files, libc and libm only.
 * MIT licence, as gs4mpm.h.
 *
 *     #include "gs4mpm.h"
 *     #include "preview.h"
 *     ...
 *     preview_settings look = {0};     // zero: honey before white, framed by itself
 *     gs4_triangles t;
 *     if (gs4_surface(sim, GS4_FIELD_POSITION, &t) == GS4_OK)
 *         preview_write_png("honey.png", &look, &t);
 *     gs4_surface_free(sim, &t);
 *
 * How a picture is made, with four samples to a pixel:
 *   1. Solids and triangles are ray cast. Colour is by the values of the triangles, if they have
 *      any.
 *   2. The length of the view ray inside the liquid is what lies between triangles that face the
 *      eye and those that do not.
 *   3. Light comes from some 40 directions, a bundle of them close together: the key lamp, the
 *      others the sky. Each has a shadow map, so that soft shadows, contact shadows and dark
 *      corners are all one thing.
 *   4. Clear liquids absorb (Beer, Lambert) the light that falls in and what is seen through them.
 *      Liquids mirror a studio with two tall lamps by Schlick's approximation of Fresnel's factor.
 * 50 000 triangles at 960 x 720 take one to two seconds on one core and about 200 MB. */
#ifndef PREVIEW_H
#define PREVIEW_H
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- palettes: sRGB, from `low` to `high` of the field; a picture without a field takes the
 * middle colour */
enum {
    PREVIEW_COLOURS = 5
};
/* what is left of white light at the depth `clarity` */
static const float preview_honey[PREVIEW_COLOURS][3] = { { 0.98f, 0.85f, 0.48f },
                                                         { 0.95f, 0.75f, 0.33f },
                                                         { 0.90f, 0.63f, 0.20f },
                                                         { 0.78f, 0.46f, 0.11f },
                                                         { 0.55f, 0.26f, 0.05f } };
static const float preview_chocolate[PREVIEW_COLOURS][3] = { { 0.19f, 0.09f, 0.05f },
                                                             { 0.26f, 0.13f, 0.08f },
                                                             { 0.34f, 0.19f, 0.12f },
                                                             { 0.45f, 0.27f, 0.17f },
                                                             { 0.58f, 0.38f, 0.25f } };
static const float preview_cream[PREVIEW_COLOURS][3] = { { 0.95f, 0.86f, 0.72f },
                                                         { 0.97f, 0.90f, 0.79f },
                                                         { 0.98f, 0.93f, 0.84f },
                                                         { 0.99f, 0.96f, 0.90f },
                                                         { 1.00f, 0.98f, 0.95f } };
static const float preview_heat[PREVIEW_COLOURS][3] = { { 0.07f, 0.10f, 0.38f },
                                                        { 0.42f, 0.10f, 0.50f },
                                                        { 0.82f, 0.16f, 0.24f },
                                                        { 0.97f, 0.53f, 0.12f },
                                                        { 1.00f, 0.92f, 0.42f } };
static const float preview_speed[PREVIEW_COLOURS][3] = { { 0.05f, 0.25f, 0.55f },
                                                         { 0.08f, 0.45f, 0.75f },
                                                         { 0.25f, 0.67f, 0.88f },
                                                         { 0.62f, 0.86f, 0.95f },
                                                         { 0.97f, 0.99f, 1.00f } };

/* ---- what to draw beside the liquid ---------------------------------------------------------- */
typedef enum preview_kind {
    /* endless plane through a, normal b or up; radius: side of its squares, 0: plain */
    PREVIEW_FLOOR = 0,
    PREVIEW_SPHERE, /* centre a, radius */
    PREVIEW_BOX,    /* low corner a, high corner b */
    /* the same seen from within: only its far walls are drawn, and cast no shadow */
    PREVIEW_ROOM,
    PREVIEW_CYLINDER, /* capped, from a to b, radius */
    /* triangles, moved by a; creases sharper than 40 degrees stay sharp */
    PREVIEW_MESH
} preview_kind;
typedef struct preview_solid { /* at most 127 are drawn */
    preview_kind kind;
    float a[3], b[3], radius;
    float colour[3]; /* sRGB; zero: light grey, floors and rooms as the background */
    const gs4_real *vertices;
    int vertex_count;
    const int *triangles;
    int triangle_count;
} preview_solid;

typedef struct preview_settings {
    int width, height; /* pixels; 0: 960 x 720 */
    /* eye = target: chosen so that the cloud fills the picture; up zero: (0, 1, 0) */
    float eye[3], target[3], up[3];
    float field_of_view; /* degrees from bottom to top; 0: 35 */
    /* m, a quarter of a cell: how near shadows and clear liquids are told apart; 0: measured */
    float radius;
    float low, high; /* of the field; equal: from its least to its greatest value */
    /* NULL: preview_honey; count 0: PREVIEW_COLOURS */
    const float (*palette)[3];
    int palette_count;
    /* m of liquid that turn white light into the palette's colour; 0: six spacings for
     * preview_honey, opaque for all others */
    float clarity;
    /* strength of the mirror image in the liquid; 0: 1 (wet), negative: none */
    float shine;
    float background[3]; /* sRGB; zero: near white */
    const preview_solid *solids;
    int solid_count;
} preview_settings;

/* ---- vectors --------------------------------------------------------------------------------- */
typedef struct preview_vec {
    float x, y, z;
} preview_vec;
static preview_vec preview_make(float x, float y, float z)
{
    preview_vec r;
    r.x = x;
    r.y = y;
    r.z = z;
    return r;
}
static preview_vec preview_load(const float *p) { return preview_make(p[0], p[1], p[2]); }
static preview_vec preview_read(const gs4_real *p)
{
    return preview_make((float)p[0], (float)p[1], (float)p[2]);
}
static preview_vec preview_add(preview_vec a, preview_vec b, float s) /* a + s b */
{
    return preview_make(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z);
}
static preview_vec preview_mul(preview_vec a, preview_vec b)
{
    return preview_make(a.x * b.x, a.y * b.y, a.z * b.z);
}
static preview_vec preview_scale(preview_vec a, float s)
{
    return preview_make(a.x * s, a.y * s, a.z * s);
}
static preview_vec preview_mix(preview_vec a, preview_vec b, float t)
{
    return preview_add(preview_scale(a, 1 - t), b, t);
}
static preview_vec preview_low(preview_vec a, preview_vec b)
{
    return preview_make(fminf(a.x, b.x), fminf(a.y, b.y), fminf(a.z, b.z));
}
static preview_vec preview_high(preview_vec a, preview_vec b)
{
    return preview_make(fmaxf(a.x, b.x), fmaxf(a.y, b.y), fmaxf(a.z, b.z));
}
static preview_vec preview_power(preview_vec a, float x)
{
    return preview_make(powf(a.x, x), powf(a.y, x), powf(a.z, x));
}
static preview_vec preview_cross(preview_vec a, preview_vec b)
{
    return preview_make(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static float preview_dot(preview_vec a, preview_vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static float preview_size(preview_vec a) { return sqrtf(preview_dot(a, a)); }
static preview_vec preview_unit(preview_vec a)
{
    float d = preview_size(a);
    return preview_scale(a, d > 0 ? 1 / d : 0);
}
/* NaN: low */
static float preview_clamp(float x, float low, float high)
{
    return x > low ? x < high ? x : high : low;
}
static float preview_ramp(float x, float low, float high)
{
    x = preview_clamp((x - low) / (high - low), 0, 1);
    return x * x * (3 - 2 * x);
}

/* ---- PNG: Paeth filter, LZ77, one block with Huffman codes of its own (RFC 1950, 1951, 2083) - */
typedef struct preview_bits {
    unsigned char *data;
    size_t count;
    unsigned long hold;
    int held;
} preview_bits;

static void preview_put(preview_bits *b, unsigned value, int bits)
{
    /* at most 7 + 16 bits: 32 are enough */
    b->hold |= (unsigned long)value << b->held;
    for (b->held += bits; b->held >= 8; b->held -= 8, b->hold >>= 8)
        b->data[b->count++] = (unsigned char)b->hold;
}

/* Huffman code of n symbols by frequency: lengths up to 15, codes with their first bit lowest,
 * as deflate sends them. */
static void preview_huffman(unsigned *frequency, int n, unsigned char *length, unsigned *code)
{
    int longest = 16;
    unsigned next = 0;
    while (longest > 15) {
        unsigned weight[2 * 286];
        int parent[2 * 286], nodes = n;
        for (int i = 0; i < n; ++i) {
            weight[i] = frequency[i];
            parent[i] = -1;
        }
        /* join the two rarest until one is left */
        for (;;) {
            int a = -1, b = -1;
            for (int i = 0; i < nodes; ++i) {
                if (!weight[i] || parent[i] >= 0) continue;
                if (a < 0 || weight[i] < weight[a]) {
                    b = a;
                    a = i;
                } else if (b < 0 || weight[i] < weight[b])
                    b = i;
            }
            if (b < 0) break;
            weight[nodes] = weight[a] + weight[b];
            parent[nodes] = -1;
            parent[a] = parent[b] = nodes++;
        }
        longest = 0;
        for (int i = 0; i < n; ++i) {
            int depth = 0;
            for (int j = i; parent[j] >= 0; j = parent[j]) ++depth;
            length[i] = (unsigned char)depth;
            if (depth > longest) longest = depth;
            /* flatter, should we come round again */
            if (frequency[i]) frequency[i] = frequency[i] / 2 + 1;
        }
    }
    for (int bits = 1; bits < 16; ++bits, next <<= 1)
        for (int i = 0; i < n; ++i) {
            if (length[i] != bits) continue;
            code[i] = 0;
            for (int k = 0; k < bits; ++k) code[i] |= (next >> k & 1) << (bits - 1 - k);
            ++next;
        }
}

/* Deflate sends a length (k = 2) or distance (k = 1) as a symbol and the low `extra` bits of the
 * value. */
static int preview_symbol(int value, int k, int *extra)
{
    int e = 0;
    while (value >> e >= 2 << k) ++e;
    *extra = e;
    return (e << k) + (value >> e);
}

static int preview_hash(const unsigned char *p)
{
    return (p[0] * 2531 + p[1] * 389 + p[2] * 59 + p[3]) & 65535;
}

/* Splits data into tokens - a byte, or length << 16 | distance back - and counts the symbols
 * they will need. */
static int preview_match(const unsigned char *data, int n, unsigned *token, int *head, int *before,
                         unsigned use[2][286])
{
    int tokens = 0, extra;
    for (int i = 0; i < 65536; ++i) head[i] = -1;
    for (int i = 0, end; i < n;) {
        int best = 0, from = 0, limit = n - i < 258 ? n - i : 258,
            j = limit > 3 ? head[preview_hash(data + i)] : -1;
        for (int tries = 24; j >= 0 && i - j <= 32768 && tries && best < limit;
             j = before[j & 32767], --tries) {
            int l = 0;
            while (l < limit && data[j + l] == data[i + l]) ++l;
            if (l > best) {
                best = l;
                from = j;
            }
        }
        if (best < 4) {
            best = 1;
            token[tokens++] = data[i];
            ++use[0][data[i]];
        } else {
            token[tokens++] = (unsigned)best << 16 | (unsigned)(i - from);
            ++use[0][best == 258 ? 285 : 257 + preview_symbol(best - 3, 2, &extra)];
            ++use[1][preview_symbol(i - from - 1, 1, &extra)];
        }
        for (end = i + best; i < end; ++i)
            if (i + 3 < n) {
                int h = preview_hash(data + i);
                before[i & 32767] = head[h];
                head[h] = i;
            }
    }
    return tokens;
}

static void preview_deflate(preview_bits *out, const unsigned char *data, int n, unsigned *token,
                            int *chains)
{
    unsigned use[2][286] = { { 0 } }, code[2][286];
    unsigned char length[2][286];
    int tokens = preview_match(data, n, token, chains, chains + 65536, use), extra;
    /* end of block; a complete distance code */
    use[0][256] = 1;
    ++use[1][0];
    ++use[1][1];
    preview_huffman(use[0], 286, length[0], code[0]);
    preview_huffman(use[1], 30, length[1], code[1]);
    preview_put(out, 5, 3);
    preview_put(out, 29, 5);
    preview_put(out, 29, 5);
    preview_put(out, 15, 4);
    /* code lengths come as plain 4-bit numbers, */
    for (int i = 0; i < 19; ++i) preview_put(out, i < 3 ? 0 : 4, 3);
    /* high bit first */
    for (int i = 0; i < 316; ++i) {
        unsigned l = i < 286 ? length[0][i] : length[1][i - 286];
        preview_put(out, (l & 1) << 3 | (l & 2) << 1 | (l & 4) >> 1 | l >> 3, 4);
    }
    for (int i = 0; i < tokens; ++i) {
        int l = (int)(token[i] >> 16), d = (int)(token[i] & 65535) - 1, s = (int)token[i];
        extra = 0;
        if (l) s = l == 258 ? 285 : 257 + preview_symbol(l - 3, 2, &extra);
        preview_put(out, code[0][s], length[0][s]);
        if (!l) continue;
        preview_put(out, (unsigned)(l - 3) & ((1u << (l == 258 ? 0 : extra)) - 1),
                    l == 258 ? 0 : extra);
        s = preview_symbol(d, 1, &extra);
        preview_put(out, code[1][s], length[1][s]);
        preview_put(out, (unsigned)d & ((1u << extra) - 1), extra);
    }
    preview_put(out, code[0][256], length[0][256]);
    preview_put(out, 0, 7);
}

static void preview_chunk(FILE *file, const char *type, const unsigned char *data, size_t n)
{
    unsigned crc = 0xffffffffu;
    for (int i = 24; i >= 0; i -= 8) fputc((int)(n >> i & 255), file);
    fwrite(type, 1, 4, file);
    fwrite(data, 1, n, file);
    for (size_t i = 0; i < n + 4; ++i) {
        crc ^= i < 4 ? (unsigned char)type[i] : data[i - 4];
        for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ (crc & 1 ? 0xedb88320u : 0);
    }
    for (int i = 24; i >= 0; i -= 8) fputc((int)(~crc >> i & 255), file);
}

/* 8-bit RGB, rows from the top. 0: done, 1: the file could not be written, 2: out of memory. */
static int preview_write_rgb(const char *path, int width, int height, const unsigned char *rgb)
{
    int row = 3 * width, n = height * (row + 1), failed;
    unsigned char *raw = (unsigned char *)malloc((size_t)n * 3 + 4096), *p = raw, head[13] = { 0 };
    unsigned *token = (unsigned *)malloc((size_t)n * sizeof *token), s1 = 1, s2 = 0;
    int *chains = (int *)malloc((65536 + 32768) * sizeof *chains);
    preview_bits out = { NULL, 0, 0, 0 };
    FILE *file;
    if (!raw || !token || !chains) {
        free(raw);
        free(token);
        free(chains);
        return 2;
    }
    for (int y = 0; y < height; ++y) {
        /* Paeth: the neighbour nearest to a + b - c */
        *p++ = 4;
        for (int i = 0; i < row; ++i) {
            const unsigned char *here = rgb + (size_t)y * (size_t)row + i;
            int a = i < 3 ? 0 : here[-3], b = y ? here[-row] : 0,
                c = y && i >= 3 ? here[-row - 3] : 0;
            int da = abs(b - c), db = abs(a - c), dc = abs(a + b - 2 * c);
            *p++ = (unsigned char)(*here - (da <= db && da <= dc ? a : db <= dc ? b : c));
        }
    }
    /* Adler-32 */
    for (int i = 0; i < n; ++i) {
        s1 = (s1 + raw[i]) % 65521;
        s2 = (s2 + s1) % 65521;
    }
    /* a byte never takes more than 15 bits */
    out.data = raw + n;
    preview_put(&out, 0x78, 8);
    preview_put(&out, 0x01, 8);
    preview_deflate(&out, raw, n, token, chains);
    for (int i = 3; i >= 0; --i)
        out.data[out.count++] = (unsigned char)((i > 1 ? s2 : s1) >> 8 * (i & 1));
    for (int i = 0; i < 4; ++i) {
        head[i] = (unsigned char)(width >> (24 - 8 * i));
        head[i + 4] = (unsigned char)(height >> (24 - 8 * i));
    }
    head[8] = 8;
    head[9] = 2; /* bits per channel; RGB */
    file = fopen(path, "wb");
    failed = file == NULL;
    if (file) {
        fwrite("\211PNG\r\n\032\n", 1, 8, file);
        preview_chunk(file, "IHDR", head, sizeof head);
        preview_chunk(file, "IDAT", out.data, out.count);
        preview_chunk(file, "IEND", head, 0);
        failed = ferror(file) != 0;
        if (fclose(file)) failed = 1;
    }
    free(raw);
    free(token);
    free(chains);
    return failed;
}

/* ---- cameras: the eye, and every light as a camera of parallel rays; depth is measured along
 * `ahead` */
typedef struct preview_camera {
    preview_vec eye, right, up, ahead;
    /* pixels per unit of x / depth; parallel rays: pixels per metre */
    float focal;
    int parallel, width, height;
} preview_camera;

static preview_camera preview_aim(preview_vec eye, preview_vec ahead, preview_vec up, int width,
                                  int height)
{
    preview_camera c;
    c.eye = eye;
    c.ahead = preview_unit(ahead);
    c.right = preview_cross(c.ahead, up);
    /* along up */
    if (preview_size(c.right) < 1e-3f)
        c.right = preview_cross(c.ahead, preview_make(up.y, up.z, -up.x));
    c.right = preview_unit(c.right);
    c.up = preview_cross(c.right, c.ahead);
    c.focal = 1;
    c.parallel = 0;
    c.width = width;
    c.height = height;
    return c;
}

/* Pixel coordinates of a point and its depth; returns pixels per metre there, 0 behind the eye. */
static float preview_project(const preview_camera *c, preview_vec p, float *x, float *y,
                             float *depth)
{
    preview_vec q = preview_add(p, c->eye, -1);
    float z = preview_dot(q, c->ahead), scale = c->parallel ? c->focal : z > 0 ? c->focal / z : 0;
    *depth = z;
    *x = 0.5f * (float)c->width + scale * preview_dot(q, c->right);
    *y = 0.5f * (float)c->height - scale * preview_dot(q, c->up);
    return scale;
}

/* The ray through a pixel's middle: its origin, and its direction, scaled so that its parameter
 * is depth. */
static preview_vec preview_ray(const preview_camera *c, int x, int y, preview_vec *origin)
{
    float u = (float)x + 0.5f - 0.5f * (float)c->width,
          v = 0.5f * (float)c->height - (float)y - 0.5f;
    preview_vec side =
        preview_scale(preview_add(preview_scale(c->right, u), c->up, v), 1 / c->focal);
    *origin = c->parallel ? preview_add(c->eye, side, 1) : c->eye;
    return c->parallel ? c->ahead : preview_add(c->ahead, side, 1);
}

/* Pixels from r[0], r[1] up to r[2], r[3] that a sphere may cover; all of them when it reaches
 * behind the eye. */
static void preview_cover(const preview_camera *c, preview_vec p, float radius, int *r)
{
    float x, y, z, scale = preview_project(c, p, &x, &y, &z), w = (float)c->width,
                   h = (float)c->height, reach;
    r[0] = r[1] = 0;
    r[2] = c->width;
    r[3] = c->height;
    if (!c->parallel && z < 2 * radius) return;
    reach = 1 + scale * radius * (c->parallel ? 1 : 1.5f * z / (z - radius));
    r[0] = (int)preview_clamp(x - reach, 0, w);
    r[2] = (int)preview_clamp(x + reach + 1, 0, w);
    r[1] = (int)preview_clamp(y - reach, 0, h);
    r[3] = (int)preview_clamp(y + reach + 1, 0, h);
}

static void preview_cover_triangle(const preview_camera *c, const preview_vec v[3], int range[4])
{
    preview_vec middle = preview_scale(preview_add(preview_add(v[0], v[1], 1), v[2], 1), 1.0f / 3);
    float reach = 0;
    for (int j = 0; j < 3; ++j) reach = fmaxf(reach, preview_size(preview_add(v[j], middle, -1)));
    preview_cover(c, middle, reach, range);
}

/* ---- solids ---------------------------------------------------------------------------------- */
static preview_vec preview_corner(const preview_solid *s, int i)
{
    return preview_add(preview_read(s->vertices + 3 * (size_t)i), preview_load(s->a), 1);
}

/* Bounding sphere: returns its radius, 0 for a floor. */
static float preview_bound(const preview_solid *s, preview_vec *centre)
{
    preview_vec a = preview_load(s->a), b = preview_load(s->b);
    *centre = a;
    if (s->kind == PREVIEW_FLOOR) return 0;
    if (s->kind == PREVIEW_SPHERE) return s->radius;
    for (int i = 0; s->kind == PREVIEW_MESH && i < s->vertex_count; ++i) {
        preview_vec v = preview_corner(s, i);
        a = i ? preview_low(a, v) : v;
        b = i ? preview_high(b, v) : v;
    }
    *centre = preview_mix(a, b, 0.5f);
    return preview_size(preview_add(b, *centre, -1))
           + (s->kind == PREVIEW_CYLINDER ? s->radius : 0);
}

/* Capped cylinder against a ray from q, relative to one end: depth, 1e30 for none. */
static float preview_cast_cylinder(preview_vec q, preview_vec dir, preview_vec axis, float radius,
                                   preview_vec *n)
{
    float len = preview_size(axis), along, speed, dd, half, root, hit, cap;
    preview_vec p;
    axis = preview_unit(axis);
    along = preview_dot(q, axis);
    speed = preview_dot(dir, axis);
    dd = preview_dot(dir, dir) - speed * speed;
    half = preview_dot(q, dir) - along * speed;
    root = half * half - dd * (preview_dot(q, q) - along * along - radius * radius);
    if (!(root > 0)) return 1e30f;
    hit = (-half - sqrtf(root)) / dd;
    along += hit * speed;
    *n = preview_scale(preview_add(preview_add(q, dir, hit), axis, -along), 1 / radius);
    if (along > 0 && along < len) return hit;
    /* past an end: through its cap or not at all */
    cap = (along > 0 ? len - along : -along) / speed;
    p = preview_add(preview_add(q, dir, hit + cap), axis, along > 0 ? -len : 0);
    *n = preview_scale(axis, along > 0 ? 1.0f : -1.0f);
    return cap > 0 && preview_size(p) <= radius ? hit + cap : 1e30f;
}

/* Box against a ray: depth of its last entry into three slabs, or for a room of its first exit. */
static float preview_cast_box(const preview_solid *s, preview_vec from, preview_vec dir,
                              preview_vec *n)
{
    float o[3], d[3], in = -1e30f, out = 1e30f, normal[3] = { 0, 0, 0 };
    int first = 0, last = 0, room = s->kind == PREVIEW_ROOM, axis;
    o[0] = from.x;
    o[1] = from.y;
    o[2] = from.z;
    d[0] = dir.x;
    d[1] = dir.y;
    d[2] = dir.z;
    for (int i = 0; i < 3; ++i) {
        float enter = ((d[i] > 0 ? s->a : s->b)[i] - o[i]) / d[i],
              leave = ((d[i] > 0 ? s->b : s->a)[i] - o[i]) / d[i];
        if (enter > in) {
            in = enter;
            first = i;
        }
        if (leave < out) {
            out = leave;
            last = i;
        }
    }
    axis = room ? last : first;
    normal[axis] = d[axis] > 0 ? -1.0f : 1.0f;
    *n = preview_load(normal);
    return !(in < out) ? 1e30f : room ? out : in;
}

/* A solid against a ray: lowers *t and returns 1, with the normal through n, if it is hit before
 * *t. */
static int preview_cast(const preview_solid *s, preview_vec up, preview_vec from, preview_vec dir,
                        float *t, preview_vec *n)
{
    preview_vec b = preview_load(s->b), q = preview_add(from, preview_load(s->a), -1);
    float hit;
    if (s->kind == PREVIEW_FLOOR) {
        *n = preview_size(b) > 0 ? preview_unit(b) : up;
        hit = -preview_dot(q, *n) / preview_dot(dir, *n);
    } else if (s->kind == PREVIEW_SPHERE) {
        float dd = preview_dot(dir, dir), half = preview_dot(q, dir);
        float root = half * half - dd * (preview_dot(q, q) - s->radius * s->radius);
        hit = root > 0 ? (-half - sqrtf(root)) / dd : 1e30f;
        *n = preview_scale(preview_add(q, dir, hit), 1 / s->radius);
    } else if (s->kind == PREVIEW_CYLINDER)
        hit = preview_cast_cylinder(q, dir, preview_add(b, preview_load(s->a), -1), s->radius, n);
    else
        hit = preview_cast_box(s, from, dir, n);
    if (!(hit > 0 && hit < *t)) return 0;
    *t = hit;
    return 1;
}

/* Triangle against a ray (Moeller, Trumbore 1997): the same, with the weights of the second and
 * third corner. */
static int preview_cast_triangle(const preview_vec *v, preview_vec from, preview_vec dir, float *t,
                                 float *w)
{
    preview_vec e1 = preview_add(v[1], v[0], -1), e2 = preview_add(v[2], v[0], -1),
                q = preview_add(from, v[0], -1);
    preview_vec p = preview_cross(dir, e2), r = preview_cross(q, e1);
    float det = preview_dot(e1, p), hit = preview_dot(e2, r) / det;
    w[1] = preview_dot(q, p) / det;
    w[2] = preview_dot(dir, r) / det;
    w[0] = 1 - w[1] - w[2];
    if (!(w[0] >= 0 && w[1] >= 0 && w[2] >= 0 && hit > 0 && hit < *t)) return 0;
    *t = hit;
    return 1;
}

/* Draws a mesh into a depth buffer and, for the eye, normals and ids. The first pass sums
 * normals at the vertices. */
static void preview_draw_mesh(const preview_camera *c, const preview_solid *s, int id, float *depth,
                              preview_vec *normal, unsigned char *ids)
{
    preview_vec *smooth =
        normal ? (preview_vec *)calloc((size_t)s->vertex_count + 1, sizeof *smooth) : NULL;
    for (int pass = smooth ? 0 : 1; pass < 2; ++pass)
        for (int i = 0; i < s->triangle_count; ++i) {
            const int *k = s->triangles + 3 * (size_t)i;
            preview_vec v[3], face, from;
            float w[3];
            int r[4];
            for (int j = 0; j < 3; ++j) v[j] = preview_corner(s, k[j]);
            face = preview_cross(preview_add(v[1], v[0], -1), preview_add(v[2], v[0], -1));
            for (int j = 0; j < 3 && !pass; ++j) smooth[k[j]] = preview_add(smooth[k[j]], face, 1);
            if (!pass) continue;
            face = preview_unit(face);
            preview_cover_triangle(c, v, r);
            for (int y = r[1]; y < r[3]; ++y)
                for (int x = r[0]; x < r[2]; ++x) {
                    int at = y * c->width + x;
                    preview_vec dir = preview_ray(c, x, y, &from), n = preview_make(0, 0, 0);
                    if (!preview_cast_triangle(v, from, dir, depth + at, w) || !normal) continue;
                    for (int j = 0; j < 3; ++j) {
                        preview_vec u = smooth ? preview_unit(smooth[k[j]]) : face;
                        n = preview_add(n, preview_dot(u, face) > 0.76f ? u : face, w[j]);
                    }
                    normal[at] = preview_unit(n);
                    ids[at] = (unsigned char)id;
                }
        }
    free(smooth);
}

/* All solids into a depth buffer. Lights pass no normals and ids, and see neither floors nor
 * rooms. */
static void preview_draw_solids(const preview_camera *c, const preview_settings *set,
                                preview_vec up, float *depth, preview_vec *normal,
                                unsigned char *ids)
{
    for (int i = 0; i < set->solid_count && i < 127; ++i) {
        const preview_solid *s = set->solids + i;
        preview_vec centre, from, n;
        float radius = preview_bound(s, &centre);
        int r[4];
        if (s->kind == PREVIEW_MESH) {
            preview_draw_mesh(c, s, i + 1, depth, normal, ids);
            continue;
        }
        if (!normal && (s->kind == PREVIEW_FLOOR || s->kind == PREVIEW_ROOM)) continue;
        preview_cover(c, centre, radius > 0 ? radius : 1e30f, r);
        for (int y = r[1]; y < r[3]; ++y)
            for (int x = r[0]; x < r[2]; ++x) {
                int at = y * c->width + x;
                preview_vec dir = preview_ray(c, x, y, &from);
                if (!preview_cast(s, up, from, dir, depth + at, &n) || !normal) continue;
                normal[at] = n;
                ids[at] = (unsigned char)(i + 1);
                if (s->kind == PREVIEW_FLOOR && s->radius > 0) { /* squares */
                    preview_camera flat =
                        preview_aim(preview_load(s->a), n, preview_make(n.y, n.z, -n.x), 1, 1);
                    preview_vec q = preview_add(preview_add(from, dir, depth[at]), flat.eye, -1);
                    float u = floorf(preview_dot(q, flat.right) / s->radius),
                          v = floorf(preview_dot(q, flat.up) / s->radius);
                    if (fabsf(fmodf(u + v, 2)) > 0.5f) ids[at] |= 128;
                }
            }
    }
}

/* ---- the liquid's surface -------------------------------------------------------------------- */

/* What a ray meets of it: place, normal and value of the first, and how much of it is inside. */
typedef struct preview_skin {
    float *front, *length, *value;
    preview_vec *normal;
} preview_skin;

static preview_vec preview_vertex(const gs4_triangles *t, int i)
{
    return preview_read(t->positions + 3 * (size_t)i);
}

/* Mean length of the first sides of triangles: about a cell. */
static float preview_side(const gs4_triangles *t)
{
    float sum = 0;
    for (int i = 0; i < t->triangle_count; ++i)
        sum += preview_size(preview_add(preview_vertex(t, t->triangles[3 * i]),
                                        preview_vertex(t, t->triangles[3 * i + 1]), -1));
    return t->triangle_count ? sum / (float)t->triangle_count : 0;
}

/* Draws all triangles. Lights ask for front and length alone; what `wall` hides counts for
 * neither. */
static void preview_draw_skin(const preview_camera *c, const gs4_triangles *t, const float *wall,
                              preview_skin *skin)
{
    for (int i = 0; i < t->triangle_count; ++i) {
        const int *k = t->triangles + 3 * (size_t)i;
        preview_vec v[3], face, from;
        float w[3];
        int r[4];
        for (int j = 0; j < 3; ++j) v[j] = preview_vertex(t, k[j]);
        face = preview_cross(preview_add(v[1], v[0], -1), preview_add(v[2], v[0], -1));
        preview_cover_triangle(c, v, r);
        for (int y = r[1]; y < r[3]; ++y)
            for (int x = r[0]; x < r[2]; ++x) {
                int at = y * c->width + x;
                preview_vec dir = preview_ray(c, x, y, &from), n = preview_make(0, 0, 0);
                float depth = 1e30f;
                if (!preview_cast_triangle(v, from, dir, &depth, w)) continue;
                skin->length[at] +=
                    (preview_dot(face, dir) > 0 ? 1.0f : -1.0f) * fminf(depth, wall[at]);
                if (!(depth < skin->front[at])) continue;
                skin->front[at] = depth;
                if (!skin->normal) continue;
                for (int j = 0; j < 3; ++j)
                    n = preview_add(n, preview_read(t->normals + 3 * (size_t)k[j]), w[j]);
                skin->normal[at] = preview_unit(n);
                skin->value[at] = 0;
                for (int j = 0; j < 3 && t->values; ++j)
                    skin->value[at] += w[j] * (float)t->values[k[j]];
            }
    }
}

/* ---- the scene ------------------------------------------------------------------------------- */
/* a point to be lit and shaded; `tinted` light has come through clear liquid */
typedef struct preview_entry {
    preview_vec p, n, colour;
    float direct, tinted, length, value;
    int at, liquid;
} preview_entry;

typedef struct preview_scene {
    preview_settings set;
    const gs4_triangles *skin;
    float spacing;      /* m, half a cell */
    preview_camera eye; /* twice the picture's width and height */
    preview_vec up, key, centre, backdrop;
    float bound;         /* radius of liquid and solids about `centre` */
    float *wall, *front; /* depth of solids and liquid, for every sample */
    preview_skin seen;   /* the same front */
    /* of the solids: index from 1, plus 128 on a dark square */
    preview_vec *normal;
    unsigned char *ids;
    /* the entry of the solid and of the liquid, -1: nothing there */
    int *lit[2];
    preview_entry *entries;
    int entry_count;
} preview_scene;

/* Defaults, camera, bounds. */
static void preview_prepare(preview_scene *s)
{
    preview_settings *set = &s->set;
    preview_vec low = preview_make(1e30f, 1e30f, 1e30f), high = preview_scale(low, -1),
                eye = preview_load(set->eye);
    preview_vec target = preview_load(set->target), none = preview_make(0, 0, 0);
    float least = 1e30f, most = -1e30f, size, angle;
    for (int i = 0; i < s->skin->vertex_count; ++i) {
        preview_vec p = preview_vertex(s->skin, i);
        float f = s->skin->values ? (float)s->skin->values[i] : 0;
        low = preview_low(low, p);
        high = preview_high(high, p);
        least = fminf(least, f);
        most = fmaxf(most, f);
    }
    if (low.x > high.x) low = high = target;
    s->centre = preview_mix(low, high, 0.5f);
    size = fmaxf(preview_size(preview_add(high, s->centre, -1)), 1e-6f);
    if (set->width <= 0 || set->height <= 0) {
        set->width = 960;
        set->height = 720;
    }
    if (!(set->field_of_view > 0)) set->field_of_view = 35;
    if (!set->palette) {
        set->palette = preview_honey;
        set->palette_count = 0;
    }
    if (set->palette_count <= 0) set->palette_count = PREVIEW_COLOURS;
    s->spacing = set->radius > 0 ? 2 * set->radius : 0.5f * preview_side(s->skin);
    if (!(s->spacing > 0)) s->spacing = 0.1f * size;
    if (!(set->clarity > 0)) set->clarity = set->palette == preview_honey ? 6 * s->spacing : 0;
    set->shine = set->shine < 0 ? 0 : set->shine > 0 ? set->shine : 1;
    if (!(set->high > set->low)) {
        set->low = least;
        set->high = most > least ? most : least + 1;
    }
    s->backdrop = preview_size(preview_load(set->background)) > 0
                      ? preview_power(preview_load(set->background), 2.2f)
                      : preview_make(0.86f, 0.87f, 0.88f);
    s->up = preview_load(set->up);
    s->up = preview_size(s->up) > 0 ? preview_unit(s->up) : preview_make(0, 1, 0);
    angle = 0.5f * set->field_of_view * 3.14159265f / 180;
    if (eye.x == target.x && eye.y == target.y && eye.z == target.z) {
        preview_camera c = preview_aim(none, s->up, preview_make(s->up.y, s->up.z, -s->up.x), 1, 1);
        preview_vec side = preview_add(preview_scale(c.up, -0.8f), c.right, 0.4f);
        target = s->centre;
        eye = preview_add(target, preview_add(side, s->up, 0.45f), 1.1f * size / sinf(angle));
    }
    s->eye = preview_aim(eye, preview_add(target, eye, -1), s->up, 2 * set->width, 2 * set->height);
    s->eye.focal = (float)set->height / tanf(angle);
    s->key = preview_add(preview_add(s->up, s->eye.right, -0.7f),
                         preview_cross(s->up, s->eye.right), -0.35f);
    s->key = preview_unit(s->key);
    s->bound = size + s->spacing;
    for (int i = 0; i < set->solid_count; ++i) {
        preview_vec centre;
        float r = preview_bound(set->solids + i, &centre);
        if (r > 0 && set->solids[i].kind != PREVIEW_ROOM)
            s->bound = fmaxf(s->bound, preview_size(preview_add(centre, s->centre, -1)) + r);
    }
}

/* Whether samples a and b lie on one surface, so that b can take a's light. */
static int preview_same(const preview_scene *s, int liquid, int a, int b)
{
    const float *depth = liquid ? s->front : s->wall;
    if (fabsf(depth[a] - depth[b]) > s->spacing + 0.004f * depth[a]) return 0;
    return liquid || (s->ids[a] == s->ids[b] && preview_dot(s->normal[a], s->normal[b]) > 0.95f);
}

static preview_entry preview_new_entry(const preview_scene *s, int at, int liquid)
{
    preview_vec from, dir = preview_ray(&s->eye, at % s->eye.width, at / s->eye.width, &from);
    preview_entry e;
    float depth = (liquid ? s->front : s->wall)[at];
    memset(&e, 0, sizeof e);
    e.at = at;
    e.liquid = liquid;
    e.p = preview_add(from, dir, depth);
    if (liquid) {
        e.n = s->seen.normal[at];
        e.value = s->skin->values ? s->seen.value[at] : 0.5f * (s->set.low + s->set.high);
        e.length = preview_clamp(s->seen.length[at], 0, 2 * s->bound);
    } else
        e.n = preview_scale(s->normal[at], preview_dot(s->normal[at], dir) > 0 ? -1.0f : 1.0f);
    /* light that comes back from below */
    e.direct = 0.22f * (1 - preview_dot(e.n, s->up));
    return e;
}

/* Lists what is to be lit. Of the four samples of a pixel, those on the same surface share one
 * entry. */
static int preview_list(preview_scene *s)
{
    const preview_camera *c = &s->eye;
    int room = 0;
    for (int by = 0; by < c->height; by += 2)
        for (int bx = 0; bx < c->width; bx += 2)
            for (int i = 0; i < 8; ++i) {
                int liquid = i / 4, at = (by + (i >> 1 & 1)) * c->width + bx + (i & 1),
                    *lit = s->lit[liquid];
                float wall = s->wall[at], front = s->front[at];
                lit[at] = -1;
                if (liquid ? front > 1e29f || front > wall
                           : wall > 1e29f || (front < wall && !(s->set.clarity > 0)))
                    continue;
                for (int j = 0; j < (i & 3) && lit[at] < 0; ++j) {
                    int other = (by + (j >> 1)) * c->width + bx + (j & 1);
                    if (lit[other] >= 0 && preview_same(s, liquid, at, other)) lit[at] = lit[other];
                }
                if (lit[at] >= 0) continue;
                if (s->entry_count == room) {
                    void *more =
                        realloc(s->entries, (size_t)(room = 2 * room + 65536) * sizeof *s->entries);
                    if (!more) return 2;
                    s->entries = (preview_entry *)more;
                }
                s->entries[lit[at] = s->entry_count++] = preview_new_entry(s, at, liquid);
            }
    return 0;
}

/* ---- light ----------------------------------------------------------------------------------- */
enum {
    PREVIEW_KEYS = 12,
    PREVIEW_LIGHTS = 36,
    PREVIEW_MAP = 320
};

/* Direction and strength of light i: the first few fill a disc around the key, the others the
 * sky. Together they give an open floor the light 1. */
static preview_vec preview_light(const preview_scene *s, int i, float *strength)
{
    int sky = i >= PREVIEW_KEYS, n = sky ? PREVIEW_LIGHTS - PREVIEW_KEYS : PREVIEW_KEYS,
        k = sky ? i - PREVIEW_KEYS : i;
    preview_camera c = preview_aim(s->key, sky ? s->up : s->key, s->eye.right, 1, 1);
    float part = ((float)k + 0.5f) / (float)n, turn = 2.39996f * (float)k; /* golden angle */
    /* the sky is brightest above */
    float r = (sky ? 1.0f : 0.09f) * sqrtf(part), h = sky ? sqrtf(1 - part) : 1;
    *strength = (sky ? 0.72f : 0.65f) / (float)n;
    return preview_unit(preview_add(preview_add(preview_scale(c.ahead, h), c.right, r * cosf(turn)),
                                    c.up, r * sinf(turn)));
}

/* Part of a light that reaches depth z at a texel of its map. */
static float preview_reach(float wall, float front, float length, float z, float gap, float clarity)
{
    float inside = z - front - gap;
    if (z > wall + gap) return 0;
    if (inside <= 0) return 1;
    inside = fminf(inside, length) / clarity;
    return 1 / (1 + inside * (1 + 0.5f * inside)); /* near exp(-inside) */
}

/* Adds one light to every entry. The map holds solids' depth, liquid's depth and length in
 * liquid, one after another. */
static void preview_add_light(preview_scene *s, float *map, int i)
{
    float strength, bound = s->bound, h = s->spacing, fine = i < PREVIEW_KEYS ? 1.0f : 0.5f;
    preview_vec light = preview_light(s, i, &strength);
    int size = (int)preview_clamp(3.3f * fine * bound / h, 64, fine * (float)PREVIEW_MAP),
        n = size * size;
    int clear = s->set.clarity > 0;
    float *wall = map, *front = map + n, *length = map + 2 * n, texel = 2 * bound / (float)size,
          edge = (float)(size - 1);
    preview_skin shadow = { NULL, NULL, NULL, NULL };
    preview_vec source = preview_add(s->centre, light, 2 * bound);
    preview_camera c = preview_aim(source, preview_scale(light, -1), s->eye.right, size, size);
    c.parallel = 1;
    c.focal = 1 / texel;
    for (int k = 0; k < n; ++k) {
        wall[k] = front[k] = 1e30f;
        length[k] = 0;
    }
    shadow.front = front;
    shadow.length = length;
    preview_draw_solids(&c, &s->set, s->up, wall, NULL, NULL);
    preview_draw_skin(&c, s->skin, wall, &shadow);
    for (int k = 0; k < s->entry_count; ++k) {
        preview_entry *e = s->entries + k;
        float lambert = preview_dot(e->n, light),
              under = !e->liquid ? 0
                      : clear    ? 0.35f
                                 : 0.15f,
              x, y, z, part = 1;
        /* liquids scatter light below their surface */
        lambert = under + (1 - under) * lambert;
        if (lambert <= 0) continue;
        preview_project(&c, e->p, &x, &y, &z);
        x -= 0.5f;
        y -= 0.5f;
        if (x > 0 && y > 0 && x < edge && y < edge) {
            float u = x - (float)(int)x, v = y - (float)(int)y, r[4],
                  gap = e->liquid ? h + 1.5f * texel : 2 * texel;
            for (int j = 0; j < 4; ++j) {
                int t = ((int)y + (j >> 1)) * size + (int)x + (j & 1);
                r[j] = preview_reach(wall[t], front[t], length[t], z, gap,
                                     clear ? s->set.clarity : 1e-6f * bound);
            }
            part = (r[0] * (1 - u) + r[1] * u) * (1 - v) + (r[2] * (1 - u) + r[3] * u) * v;
        }
        e->direct += strength * lambert * part * part;
        e->tinted += strength * lambert * part * (1 - part);
    }
}

/* ---- colour ---------------------------------------------------------------------------------- */
static preview_vec preview_colour(const preview_settings *set, float value)
{
    int last = set->palette_count - 1, k;
    float t = preview_clamp((value - set->low) / (set->high - set->low), 0, 1) * (float)last;
    k = (int)t < last ? (int)t : last > 0 ? last - 1 : 0;
    return preview_mix(preview_power(preview_load(set->palette[k]), 2.2f),
                       preview_power(preview_load(set->palette[last > 0 ? k + 1 : 0]), 2.2f),
                       t - (float)k);
}

static preview_vec preview_backdrop(const preview_scene *s, preview_vec dir)
{
    return preview_scale(s->backdrop,
                         1 - 0.35f * preview_ramp(preview_dot(preview_unit(dir), s->up), 0, 0.9f));
}

/* The studio as the liquid mirrors it: plain, with a tall lamp towards the key and a dim one to
 * the right. */
static preview_vec preview_studio(const preview_scene *s, preview_vec d)
{
    float h = preview_dot(d, s->up),
          tall = preview_ramp(h, -0.25f, 0) * (1 - preview_ramp(h, 0.75f, 0.9f));
    preview_vec flat = preview_unit(preview_add(d, s->up, -h));
    preview_vec to = preview_unit(preview_add(s->key, s->up, -preview_dot(s->key, s->up)));
    float lamps = 14 * preview_ramp(preview_dot(flat, to), 0.93f, 0.96f);
    lamps += 1.5f * preview_ramp(preview_dot(d, s->eye.right), 0.75f, 0.85f);
    return preview_add(preview_scale(s->backdrop, h < 0 ? 0.70f : 0.85f),
                       preview_make(1, 0.98f, 0.95f), tall * lamps);
}

static float preview_fresnel(preview_vec dir, preview_vec n)
{
    float m = 1 - preview_clamp(-preview_dot(dir, n), 0, 1);
    return 0.04f + 0.96f * m * m * m * m * m;
}

static preview_vec preview_light_on(const preview_entry *e, preview_vec tint)
{
    return preview_add(preview_make(e->direct, e->direct, e->direct), tint, e->tinted);
}

static preview_vec preview_shade_solid(const preview_scene *s, const preview_entry *e)
{
    const preview_solid *solid = s->set.solids + (s->ids[e->at] & 127) - 1;
    preview_vec dir = preview_unit(preview_add(e->p, s->eye.eye, -1)),
                colour = preview_load(solid->colour);
    float far = preview_size(preview_add(e->p, s->centre, -1)) / s->bound;
    if (preview_size(colour) > 0)
        colour = preview_power(colour, 2.2f);
    else if (solid->kind == PREVIEW_FLOOR || solid->kind == PREVIEW_ROOM)
        colour = s->backdrop;
    else
        colour = preview_make(0.70f, 0.71f, 0.73f);
    colour = preview_mul(
        colour, preview_light_on(e, preview_colour(&s->set, 0.5f * (s->set.low + s->set.high))));
    if (s->ids[e->at] & 128) colour = preview_scale(colour, 0.82f);
    if (solid->kind == PREVIEW_FLOOR)
        return preview_mix(colour, preview_backdrop(s, dir), preview_ramp(far, 1.5f, 7));
    return preview_mix(colour, preview_scale(s->backdrop, 0.8f), 0.5f * preview_fresnel(dir, e->n));
}

/* What is seen through clear liquid, bent aside a little by its surface. */
static preview_vec preview_behind(const preview_scene *s, const preview_entry *e)
{
    const preview_camera *c = &s->eye;
    float slide = fminf(0.25f * e->length * c->focal / fmaxf(s->front[e->at], 1e-3f * s->bound),
                        (float)c->width);
    int x = e->at % c->width - (int)(slide * preview_dot(e->n, c->right));
    int y = e->at / c->width + (int)(slide * preview_dot(e->n, c->up)), at = e->at, inside;
    preview_vec from;
    inside = x >= 0 && y >= 0 && x < c->width && y < c->height;
    if (inside && s->wall[y * c->width + x] > s->front[at]) at = y * c->width + x;
    if (s->lit[0][at] >= 0) return s->entries[s->lit[0][at]].colour;
    return preview_backdrop(s, preview_ray(c, at % c->width, at / c->width, &from));
}

static preview_vec preview_shade_liquid(const preview_scene *s, const preview_entry *e)
{
    preview_vec dir = preview_unit(preview_add(e->p, s->eye.eye, -1)),
                body = preview_colour(&s->set, e->value);
    preview_vec colour = preview_mul(body, preview_light_on(e, body)), mirror;
    float fresnel = fminf(s->set.shine * preview_fresnel(dir, e->n), 1);
    /* dark corners mirror dark corners */
    float open = preview_clamp(e->direct + e->tinted, 0.15f, 1);
    /* what passes, and what is scattered on the way */
    if (s->set.clarity > 0) {
        float deep = e->length / s->set.clarity, cloud = 0.6f * (1 - expf(-deep));
        /* of many paths the short ones are seen */
        deep = 2 * (1 - expf(-0.5f * deep));
        colour = preview_mul(colour, preview_scale(preview_power(body, 0.15f * deep), 1.1f));
        colour = preview_mix(preview_mul(preview_behind(s, e), preview_power(body, deep)), colour,
                             cloud);
    }
    mirror = preview_studio(s, preview_add(dir, e->n, -2 * preview_dot(dir, e->n)));
    return preview_add(preview_scale(colour, 1 - fresnel), mirror, fresnel * open);
}

static int preview_render(preview_scene *s, unsigned char *rgb, float *map)
{
    const preview_camera *c = &s->eye;
    int n = c->width * c->height;
    for (int i = 0; i < n; ++i) {
        s->wall[i] = s->front[i] = 1e30f;
        s->seen.length[i] = 0;
        s->ids[i] = 0;
    }
    preview_draw_solids(c, &s->set, s->up, s->wall, s->normal, s->ids);
    preview_draw_skin(c, s->skin, s->wall, &s->seen);
    if (preview_list(s)) return 2;
    for (int i = 0; i < PREVIEW_LIGHTS; ++i) preview_add_light(s, map, i);
    /* liquids show solids */
    for (int liquid = 0; liquid < 2; ++liquid)
        for (int i = 0; i < s->entry_count; ++i) {
            preview_entry *e = s->entries + i;
            if (e->liquid == liquid)
                e->colour = liquid ? preview_shade_liquid(s, e) : preview_shade_solid(s, e);
        }
    for (int y = 0; y < c->height; y += 2)
        for (int x = 0; x < c->width; x += 2) {
            preview_vec sum = preview_make(0, 0, 0), limit = preview_make(1.2f, 1.2f, 1.2f), from;
            for (int k = 0; k < 4; ++k) {
                int at = (y + (k >> 1)) * c->width + x + (k & 1),
                    i = s->lit[s->lit[1][at] >= 0][at];
                preview_vec v = i >= 0 ? s->entries[i].colour
                                       : preview_backdrop(s, preview_ray(c, x, y, &from));
                sum = preview_add(sum, preview_low(v, limit), 0.25f);
            }
            *rgb++ = (unsigned char)(255 * powf(preview_clamp(sum.x, 0, 1), 1 / 2.2f) + 0.5f);
            *rgb++ = (unsigned char)(255 * powf(preview_clamp(sum.y, 0, 1), 1 / 2.2f) + 0.5f);
            *rgb++ = (unsigned char)(255 * powf(preview_clamp(sum.z, 0, 1), 1 / 2.2f) + 0.5f);
        }
    return 0;
}

/* Draws triangles into a PNG file. 0: done, 1: the file could not be written, 2: out of memory. */
static int preview_write_png(const char *path, const preview_settings *set, const gs4_triangles *t)
{
    preview_scene s;
    unsigned char *rgb;
    float *map;
    size_t n;
    int failed = 0;
    memset(&s, 0, sizeof s);
    if (set) s.set = *set;
    s.skin = t;
    preview_prepare(&s);
    n = (size_t)s.eye.width * (size_t)s.eye.height;
    map = (float *)malloc((size_t)3 * PREVIEW_MAP * PREVIEW_MAP * sizeof *map);
    s.wall = (float *)malloc(n * sizeof *s.wall);
    s.front = s.seen.front = (float *)malloc(n * sizeof *s.front);
    s.seen.length = (float *)malloc(n * sizeof *s.seen.length);
    s.seen.value = (float *)malloc(n * sizeof *s.seen.value);
    s.seen.normal = (preview_vec *)malloc(n * sizeof *s.seen.normal);
    s.normal = (preview_vec *)malloc(n * sizeof *s.normal);
    s.ids = (unsigned char *)malloc(n);
    s.lit[0] = (int *)malloc(n * sizeof *s.lit[0]);
    s.lit[1] = (int *)malloc(n * sizeof *s.lit[1]);
    /* 3 bytes for every 4 samples */
    rgb = (unsigned char *)malloc(n);
    if (!map || !s.wall || !s.front || !s.seen.length || !s.seen.value || !s.seen.normal
        || !s.normal || !s.ids || !s.lit[0] || !s.lit[1] || !rgb)
        failed = 2;
    if (!failed) failed = preview_render(&s, rgb, map);
    if (!failed) failed = preview_write_rgb(path, s.set.width, s.set.height, rgb);
    free(map);
    free(s.wall);
    free(s.front);
    free(s.seen.length);
    free(s.seen.value);
    free(s.seen.normal);
    free(s.normal);
    free(s.ids);
    free(s.lit[0]);
    free(s.lit[1]);
    free(rgb);
    free(s.entries);
    return failed;
}

#endif
