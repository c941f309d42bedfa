#pragma once

#include <functional>

namespace mvstudio::cli {

/// For the first line of main(): a closed pipe is an error of the write and no end without a word, the ends of children can be
/// awaited whatever the caller ignores, and no output file becomes stdout because that was closed.
void PrepareProcess();

/// SIGINT, SIGTERM and SIGHUP (unless ignored, as by nohup) ask the running command to stop. One that has not after about three
/// seconds, or at once on a second signal, is ended: its children first, then its temporary files; `last_words(signal)` is then
/// called on another thread to say so, and the process ends with 128 + signal. All within five seconds.
void InstallSignalHandlers(const std::function<void(int)>& last_words);

/// The signal received first, or 0.
int ReceivedSignal();

/// To be called before the outcome is printed: from then on nobody else prints. Does not return when the process is being ended
/// already.
void ClaimOutput();

}  // namespace mvstudio::cli
