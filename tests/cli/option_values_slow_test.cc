#include <atomic>
#include <thread>

#include "tests/support/run_cli.h"
#include "tests/support/test.h"

/// Every option of every command, as its help lists them, with values that its type does not have.
namespace mvstudio::testing {
namespace {

struct Option {
  std::string command, name, type;
};

/// All options of a command; the list of its subcommands where it has some, as `--help-all` would unfold them.
std::string HelpOf(const std::string& command) {
  std::vector<std::string> words = WordsOf(command);
  words.push_back("--help");
  const std::string help = RunCli(words).out;
  if (help.find("Subcommands:") != std::string::npos) return help;
  words.back() = "--help-all";
  return RunCli(words).out;
}

/// "  --steps INT=600   training steps", "  IN TEXT ... REQUIRED   calibration file".
void AddOption(const std::string& command, const std::string& line, std::vector<Option>* options) {
  std::istringstream in(line);
  std::string name, type;
  in >> name >> type;
  name = name.substr(0, name.find(','));
  for (const char* known : {"INT", "UINT", "FLOAT", "TEXT"}) {
    const std::string head = type.substr(0, type.find_first_of(":="));
    if (head == known && name.rfind("--", 0) == 0) options->push_back({command, name, known});
  }
}

/// Subcommands of a command, or its options when it has none.
void Visit(const std::string& command, std::vector<Option>* options) {
  std::istringstream help(HelpOf(command));
  std::vector<std::string> subcommands;
  bool listing = false;
  for (std::string line; std::getline(help, line);) {
    listing = listing || line.rfind("Subcommands:", 0) == 0;
    const bool item = line.size() > 2 && line.compare(0, 2, "  ") == 0 && line[2] != ' ';
    if (item && listing) subcommands.push_back(line.substr(2, line.find(' ', 2) - 2));
    if (item && !listing) AddOption(command, line, options);
  }
  for (const std::string& name : subcommands) Visit(command + (command.empty() ? "" : " ") + name, options);
}

std::string WrongValue(const std::string& type, size_t number) {
  if (type == "INT") return "-2";
  if (type == "UINT") return "-1";
  if (type == "FLOAT") return number % 2 == 0 ? "nan" : "-inf";
  return "";
}

std::string FaultOf(const Option& option, const std::string& value) {
  std::vector<std::string> words = WordsOf(option.command);
  words.insert(words.end(), {option.name, value});
  const CliRun run = RunCli(words, "timeout 30 ");
  const bool one_line = std::count(run.err.begin(), run.err.end(), '\n') == 1;
  if (run.exit == 2 && one_line && run.err.find(option.name) != std::string::npos && run.out.empty()) return "";
  return option.command + " " + option.name + " '" + value + "': exit " + std::to_string(run.exit) + ", " + run.err;
}

TEST(OptionValues, WrongOnesAreRefusedByEveryOptionOfEveryCommand) {
  std::vector<Option> options;
  Visit("", &options);
  ASSERT_GT(options.size(), 300u);
  std::vector<std::pair<Option, std::string>> cases;
  for (const Option& option : options) cases.emplace_back(option, WrongValue(option.type, cases.size()));
  std::vector<std::string> faults(cases.size());
  std::atomic<size_t> next{0};
  const auto work = [&] {
    for (size_t i = next++; i < cases.size(); i = next++) faults[i] = FaultOf(cases[i].first, cases[i].second);
  };
  std::thread other(work);
  work();
  other.join();
  for (const std::string& fault : faults) {
    if (!fault.empty()) ADD_FAILURE() << fault;
  }
  std::cout << options.size() << " options\n";
}

}  // namespace
}  // namespace mvstudio::testing
