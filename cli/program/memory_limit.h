#pragma once

/// Where little address space may be used: `ulimit -v` or `-d`, or a system that promises no more memory than it has.
///
/// OpenBLAS takes 128 MB for each of its threads, and asks for ever where it gets none. There it is left with one thread, and
/// what that one needs is taken before anything else can take it.
namespace mvstudio::cli {

/// Whether so little memory may be used that OpenBLAS could be short of it.
bool MemoryIsLimited();

/// Becomes this program again with one thread of OpenBLAS, where memory is limited: its threads begin before main() does.
void LimitBlasThreads(char** argv);

/// Takes what OpenBLAS needs, where memory is limited. Throws ResourceError when `needed` and there is not that much.
void ReserveBlasMemory(bool needed);

}  // namespace mvstudio::cli
