#pragma once

/// Two programs share the work, because loading libtorch costs more than most commands: `mvstudio` does without it and replaces
/// itself by `mvstudio-avatar`, which lies beside it and knows every command, where one needs it. A build without libtorch has
/// `mvstudio` alone.
namespace mvstudio::cli {

/// Whether this program runs what `argv` asks for; help over all commands and mistakes are left to the program that knows all.
bool Runs(char** argv);

/// Whether `argv` names a command that trains.
bool Trains(char** argv);

/// Becomes `mvstudio-avatar`. Comes back only by MissingToolError, when that is not possible, and by
/// ResourceError, when memory is limited too much for it.
[[noreturn]] void HandOver(char** argv);

/// Where little address space may be used (`ulimit -v` or `-d`, or a system that promises no more memory than it has), OpenBLAS
/// asks for ever for the 128 MB of each of its threads. There it is left with one thread, and what that one needs is taken
/// before anything else can take it.
/// Whether so little memory may be used that OpenBLAS could be short of it.
bool MemoryIsLimited();

/// Becomes this program again with one thread of OpenBLAS, where memory is limited: its threads begin before main() does.
void LimitBlasThreads(char** argv);

/// Takes what OpenBLAS needs, where memory is limited. Throws ResourceError when `needed` and there is not that much.
void ReserveBlasMemory(bool needed);

}  // namespace mvstudio::cli
