// The work-group that kernels are compiled for. Their argument lists, NAME_PARAMETERS, are the host's: src/manifest/ has them.

#if !defined(LOCAL_X) || !defined(LOCAL_Y)
#error "LOCAL_X, LOCAL_Y: work-items of a work-group across and down"
#endif

#define GROUP_SHAPE __attribute__((reqd_work_group_size(LOCAL_X, LOCAL_Y, 1)))
