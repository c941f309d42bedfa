#pragma once

#include <functional>

#include "cli/program/command.h"

namespace mvstudio::cli {

/// What an ended command would have said itself.
using LastWords = std::function<void(const CommandResult&)>;

/// For the first line of main(): a closed pipe is an error of the write and no end without a word, the ends of children can be
/// awaited whatever the caller ignores, and no output file becomes stdout because that was closed. With the number of the
/// calling process in MVSTUDIO_CALLER this one gets SIGTERM when that ends, as mvstudio.command of the Python module wants it.
void PrepareProcess();

/// SIGINT, SIGTERM and SIGHUP (unless ignored, as by nohup) ask the running command to stop. One that has not after about three
/// seconds, or at once on a second signal, is ended: its children first, then its temporary files; `last_words` is then called
/// on another thread to say so, and the process ends with 128 + signal. All within five seconds. SIGUSR1, by which schedulers
/// announce the end of a job, asks in the same way, but nobody is ended then, and the exit code is 75. In the same way, with
/// exit code 7, ends a process that runs out of memory where nobody catches it: in a thread of a library, or before main()
/// begins.
void InstallSignalHandlers(const LastWords& last_words);

/// The signal received first, or 0.
int ReceivedSignal();

/// To be called before the outcome is printed: from then on nobody else prints. Does not return when the process is being ended
/// already.
void ClaimOutput();

}  // namespace mvstudio::cli
