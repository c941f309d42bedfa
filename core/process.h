#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

/// The one launcher of other programs. Whatever it has started ends with this process (EndChildren).
namespace mvstudio {

/// As the name of a program: this one again.
inline constexpr char kThisProgram[] = "/proc/self/exe";

/// Working folder and output files of a program.
struct ProcessFiles {
  std::string out;          ///< its stdout
  std::string err = {};     ///< its stderr; empty: `out`
  bool append = false;      ///< false: both are overwritten
  std::string folder = {};  ///< working folder; empty: the current one. `out` and `err` are relative to the current one
  bool share_err = false;   ///< its stderr is that of this process; `err` is not used
};

enum class ProcessGroup {
  kOwn,    ///< signals from a terminal do not reach the program; it is ended with what it has started
  kShared  ///< that of this process: signals from a terminal reach both; it is ended alone
};

/// Programs that run beside this one. Those that still run when this goes away are ended.
class Processes {
 public:
  explicit Processes(ProcessGroup group = ProcessGroup::kOwn) : group_(group) {}
  ~Processes() { End(); }
  Processes(const Processes&) = delete;
  Processes& operator=(const Processes&) = delete;

  /// Starts one more without a shell, with an empty stdin and the environment of this process. `words`: a path or a name on
  /// PATH, and its arguments. Throws IoError when it cannot be started, CancelledError after `EndChildren`.
  void Start(const std::vector<std::string>& words, const ProcessFiles& files);

  /// Whether one of them has ended, well or not. Nothing is awaited.
  bool AnyEnded() const;

  /// Waits for all of them. `poll` is called about 20 times a second. When it throws, all are ended and the exception
  /// propagates; when one ends with another status than 0, the others are ended. Returns for each in the order of their
  /// start: exit status, 128 + the signal that ended it, or kWasEnded. Throws IoError when one cannot be awaited.
  std::vector<int> Wait(const std::function<void()>& poll = {});
  static constexpr int kWasEnded = -1;  ///< ended because of another one

  /// Ends all of them: SIGTERM, SIGKILL after a second.
  void End();

 private:
  struct Child {
    int pid;
    std::string name;
    std::optional<int> exit = {};  ///< none: not awaited yet
  };
  bool Collect();  ///< awaits those that have ended; true when none is left

  const ProcessGroup group_;
  std::vector<Child> children_;
};

/// Runs one program to its end, in a process group of its own; as Processes::Start and Wait.
int RunProcess(const std::vector<std::string>& words, const ProcessFiles& files, const std::function<void()>& poll = {});

/// For an early exit of this process: ends all children (SIGTERM, SIGKILL after a second) and awaits them. No others can
/// be started afterwards.
void EndChildren();

}  // namespace mvstudio
