#pragma once

#include <functional>
#include <string>

namespace mvstudio {

enum class LogLevel { kDebug, kInfo, kWarning, kError };
using LogSink = std::function<void(LogLevel, const std::string&)>;

/// Sends a line to the installed sink; without a sink it is dropped. Libraries never print.
void Log(LogLevel level, const std::string& message);

/// Installs `sink` for the whole process and returns the previous one. Must not be called while other threads log.
LogSink SetLogSink(LogSink sink);

}  // namespace mvstudio
