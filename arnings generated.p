#define gs4_sphere              gs4_sphere_f64
