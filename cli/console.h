#pragma once

#include <memory>
#include <string>

#include "core/progress.h"

namespace mvstudio::cli {

/// `text` as one line that a terminal can be shown: names and paths come from foreign files and may hold line breaks, escape
/// sequences or bytes that are no UTF-8; those become spaces and '?'. Longer than 4000 bytes, the middle is left out.
std::string OneLine(const std::string& text);

/// Sends core/log to stderr through spdlog. `level`: debug, info, warning, error, off.
void InstallLog(const std::string& level);

/// SIGINT and SIGTERM ask the running command to stop; returns the signal received so far, or 0.
void InstallSignalHandlers();
int ReceivedSignal();

/// Progress on stderr: a bar on a terminal, a line every 10 s elsewhere; silent when `mode` is "none". Modes: auto, bar, plain,
/// none.
std::unique_ptr<ProgressSink> MakeProgress(const std::string& mode);

}  // namespace mvstudio::cli
