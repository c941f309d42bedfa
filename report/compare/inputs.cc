#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "report/compare/compared.h"
#include "report/page/format.h"

/// What differs in the inputs of runs, by the digests of their provenance.
namespace mvstudio::report {
namespace {

constexpr char kAbsent[] = "not there";
constexpr size_t kMostInputs = 1000;  // of a command, that a page can show

struct RecordedInput {
  std::string name, digest;
  double bytes;
};

/// Of the last line of the command's folder.
std::vector<RecordedInput> InputsOf(const RunData& run, const Stage& stage) {
  const Value* line = nullptr;
  for (const JsonFile& entry : run.provenance) {
    std::string command = entry.value["command"].Text();
    std::replace(command.begin(), command.end(), '_', ' ');
    if (entry.folder == stage.folder && command == stage.command) line = &entry.value;
  }
  std::vector<RecordedInput> inputs;
  if (!line) return inputs;
  for (const Value& input : (*line)["inputs"].items()) {
    const std::filesystem::path path(input["path"].Text());
    const std::string digest = input["sha256"].Text(input["sha256_of_list"].Text());
    if (!digest.empty() && inputs.size() < kMostInputs)
      inputs.push_back({path.filename().string(), digest, input["bytes"].Number()});
  }
  return inputs;
}

std::string InputText(const RecordedInput& input) { return FormatCount(input.bytes) + " bytes, " + input.digest.substr(0, 8); }

/// Inputs by their names; one of a name that comes twice gets a number.
std::map<std::string, RecordedInput> ByName(const std::vector<RecordedInput>& inputs) {
  std::map<std::string, RecordedInput> named;
  for (const RecordedInput& input : inputs) {
    std::string name = input.name;
    for (int i = 2; named.count(name) > 0; ++i) name = input.name + " (" + std::to_string(i) + ")";
    named.emplace(name, input);
  }
  return named;
}

std::set<std::string> Digests(const std::vector<RecordedInput>& inputs) {
  std::set<std::string> digests;
  for (const RecordedInput& input : inputs) digests.insert(input.digest);
  return digests;
}

void AddRows(const std::string& command, const std::vector<std::vector<RecordedInput>>& of_runs,
             std::vector<DifferingText>* rows) {
  std::vector<std::map<std::string, RecordedInput>> named;
  std::set<std::string> names;
  for (const auto& inputs : of_runs) {
    named.push_back(ByName(inputs));
    for (const auto& [name, input] : named.back()) names.insert(name);
  }
  for (const std::string& name : names) {
    DifferingText row{command, name, {}};
    std::set<std::string> digests;
    for (const auto& inputs : named) {
      const auto found = inputs.find(name);
      digests.insert(found == inputs.end() ? kAbsent : found->second.digest);
      row.texts.push_back(found == inputs.end() ? kAbsent : InputText(found->second));
    }
    if (digests.size() > 1) rows->push_back(std::move(row));
  }
}

}  // namespace

InputComparison CompareInputs(const ComparedRuns& runs, const std::vector<ComparedStage>& stages) {
  InputComparison result;
  for (const ComparedStage& stage : stages) {
    if (!stage.InBoth()) continue;
    std::vector<std::vector<RecordedInput>> of_runs;
    for (size_t i = 0; i < runs.size(); ++i)
      of_runs.push_back(stage.runs[i] ? InputsOf(runs.data[i], *stage.runs[i]) : std::vector<RecordedInput>());
    const std::set<std::string> first = Digests(of_runs.front()), last = Digests(of_runs.back());
    if (first.empty() || last.empty()) continue;
    const bool shared =
        std::any_of(first.begin(), first.end(), [&](const std::string& digest) { return last.count(digest) > 0; });
    if (first == last) result.same.push_back(stage.command);
    if (!shared) result.other.push_back(stage.command);
    AddRows(stage.command, of_runs, &result.differing);
  }
  return result;
}

}  // namespace mvstudio::report
