#include "core/log.h"

#include <mutex>
#include <utility>

namespace mvstudio {
namespace {

LogSink& CurrentSink() {
  static LogSink sink;
  return sink;
}

std::mutex& SinkMutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

void Log(LogLevel level, const std::string& message) {
  std::lock_guard<std::mutex> lock(SinkMutex());
  if (CurrentSink()) CurrentSink()(level, message);
}

LogSink SetLogSink(LogSink sink) {
  std::lock_guard<std::mutex> lock(SinkMutex());
  return std::exchange(CurrentSink(), std::move(sink));
}

}  // namespace mvstudio
