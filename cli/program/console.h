#pragma once

#include <memory>
#include <string>

#include "core/progress.h"

namespace mvstudio::cli {

/// Writes to stdout, at once. Throws ResourceError when that is not possible: a full disk, a pipe that is closed.
void PrintOut(const std::string& text);

enum class Colour { kRed = 31, kGreen = 32, kYellow = 33 };

/// `text` in a colour where `fd` is a terminal that has them and NO_COLOR does not forbid it, else as it is.
std::string Painted(const std::string& text, Colour colour, int fd);
/// The same for the word of a line "verdict: fail".
std::string WithPaintedVerdicts(std::string text, int fd);

/// Sends core/log to stderr through spdlog. `level`: debug, info, warning, error, off.
void InstallLog(const std::string& level);

/// Progress on stderr: a bar on a terminal, a line every 10 s elsewhere; silent when `mode` is "none". Modes: auto, bar, plain,
/// none.
std::unique_ptr<ProgressSink> MakeProgress(const std::string& mode);

}  // namespace mvstudio::cli
