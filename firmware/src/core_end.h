/* The end of a source file of the core: ends what core.h begins. */

#ifdef SF_MINSIZE
#pragma clang attribute pop
#undef SF_MINSIZE
#endif
