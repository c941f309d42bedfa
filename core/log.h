#pragma once

#include <functional>
#include <string>

namespace mvstudio {

enum class LogLevel { kDebug, kInfo, kWarning, kError };
using LogSink = std::function<void(LogLevel, const std::string&)>;

/// Sends a line to the installed sink; without a sink it is dropped. Libraries never print by themselves.
void Log(LogLevel level, const std::string& message);

/// Installs `sink` for the whole process and returns the one before. Not to be called while other threads log.
LogSink SetLogSink(LogSink sink);

}  // namespace mvstudio
