#include "cli/program/console.h"

#include <poll.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <utility>

#include "cli/program/flag_text.h"
#include "cli/program/interrupt.h"
#include "core/disk/temporary.h"
#include "core/error.h"
#include "core/format.h"
#include "core/log.h"
#include "core/text/one_line.h"

namespace mvstudio::cli {
namespace {

using Clock = std::chrono::steady_clock;

class ConsoleProgress : public ProgressSink {
 public:
  explicit ConsoleProgress(bool bar) : bar_(bar) {}

  void Begin(const std::string& stage, int64_t total) override {
    std::lock_guard<std::mutex> lock(mutex_);
    stage_ = OneLine(stage), total_ = total, done_ = 0;
    start_ = last_ = Clock::now();
    shown_ = bar_;
    if (bar_) std::fprintf(stderr, "\r\033[K%s", stage_.c_str());  // a stage of one long step is seen, too
    std::fflush(stderr);
  }
  void Advance(int64_t done, const std::string& note) override {
    std::lock_guard<std::mutex> lock(mutex_);
    done_ += done;
    const auto now = Clock::now();
    if (now - last_ < (bar_ ? std::chrono::milliseconds(150) : std::chrono::milliseconds(10000))) return;
    last_ = now;
    Show(note);
  }
  void End() override {
    std::lock_guard<std::mutex> lock(mutex_);
    if (bar_ && shown_) std::fputs("\r\033[K", stderr);
  }
  bool Cancelled() const override { return ReceivedSignal() != 0; }

 private:
  /// The first items also pay for what is read once: nothing is said before three are done.
  std::string Left(double rate) const {
    constexpr int kLeast = 3;
    if (done_ < kLeast || total_ <= done_ || !(rate > 0)) return "";
    const double left_s = static_cast<double>(total_ - done_) / rate;
    if (left_s < 100) return Format("  ETA %.0f s", left_s);
    return left_s < 6000 ? Format("  ETA %.0f min", left_s / 60) : Format("  ETA %.1f h", left_s / 3600);
  }

  void Show(const std::string& note) {
    const double elapsed = std::chrono::duration<double>(last_ - start_).count();
    const double rate = elapsed > 0 ? static_cast<double>(done_) / elapsed : 0;
    const std::string eta = Left(rate);
    const std::string speed =
        Format(rate > 0 && rate < 0.5 ? "%.1f s each" : "%.1f/s", rate > 0 && rate < 0.5 ? 1 / rate : rate);
    const std::string of = total_ < std::max<int64_t>(done_, 1) ? "" : "/" + std::to_string(total_);  // else it is not known
    std::fprintf(stderr, bar_ ? "\r\033[K%s %lld%s  %s%s  %s" : "%s %lld%s  %s%s  %s\n", stage_.c_str(),
                 static_cast<long long>(done_), of.c_str(), speed.c_str(), eta.c_str(), OneLine(note).c_str());
    std::fflush(stderr);
    shown_ = true;
  }

  const bool bar_;
  std::mutex mutex_;
  std::string stage_;
  int64_t total_ = 0, done_ = 0;
  Clock::time_point start_, last_;
  bool shown_ = false;
};

/// Silent, but still asks to stop on a signal.
class SilentProgress : public ProgressSink {
 public:
  bool Cancelled() const override { return ReceivedSignal() != 0; }
};

}  // namespace

void PrintOut(const std::string& text) {
  for (size_t at = 0; at < text.size();) {
    const ssize_t written = write(STDOUT_FILENO, text.data() + at, text.size() - at);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0 && errno == EAGAIN) {  // a terminal or pipe that somebody made so
      pollfd free = {STDOUT_FILENO, POLLOUT, 0};
      poll(&free, 1, 1000);
      continue;
    }
    if (written < 0) throw ResourceError(std::string("stdout: cannot write: ") + std::strerror(errno));
    at += static_cast<size_t>(written);
  }
}

std::string Painted(const std::string& text, Colour colour, int fd) {
  const char *forbidden = std::getenv("NO_COLOR"), *terminal = std::getenv("TERM");
  const bool dumb = !terminal || std::string(terminal) == "dumb";
  if (dumb || (forbidden && *forbidden) || isatty(fd) == 0) return text;
  return Format("\033[%dm", static_cast<int>(colour)) + text + "\033[0m";
}

std::string WithPaintedVerdicts(std::string text, int fd) {
  static const std::pair<const char*, Colour> kVerdicts[] = {
      {"pass", Colour::kGreen}, {"warn", Colour::kYellow}, {"fail", Colour::kRed}};
  const std::string head = "verdict: ";
  for (size_t at = text.find(head); at != std::string::npos; at = text.find(head, at + head.size())) {
    if (at > 0 && text[at - 1] != '\n') continue;
    for (const auto& [word, colour] : kVerdicts) {
      if (text.compare(at + head.size(), std::strlen(word), word) == 0)
        text.replace(at + head.size(), std::strlen(word), Painted(word, colour, fd));
    }
  }
  return text;
}

void InstallLog(const std::string& level) {
  auto logger = spdlog::stderr_color_mt("mvstudio");
  logger->set_pattern("%^%l%$: %v");
  logger->set_level(spdlog::level::from_str(level));
  SetLogSink([logger](LogLevel severity, const std::string& message) {
    static constexpr spdlog::level::level_enum kLevels[] = {spdlog::level::debug, spdlog::level::info, spdlog::level::warn,
                                                            spdlog::level::err};
    logger->log(kLevels[static_cast<int>(severity)], "{}", OneLine(WithFlags(FinalNames(message))));
  });
}

std::unique_ptr<ProgressSink> MakeProgress(const std::string& mode) {
  if (mode == "none") return std::make_unique<SilentProgress>();
  if (mode != "auto" && mode != "bar" && mode != "plain") {
    throw UsageError("--progress " + mode + ": expected auto, bar, plain or none");
  }
  return std::make_unique<ConsoleProgress>(mode == "bar" || (mode == "auto" && isatty(STDERR_FILENO)));
}

}  // namespace mvstudio::cli
