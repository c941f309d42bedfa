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

}  // namespace mvstudio::cli
