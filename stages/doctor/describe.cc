#include "stages/doctor/describe.h"

#include "core/format.h"
#include "core/join.h"
#include "stages/dataset/session_table.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using DoctorJson = nlohmann::ordered_json;

std::string Gigabytes(double bytes) { return Format("%.1f GiB", bytes / (1 << 30)); }

DoctorJson TextOrNull(const std::string& text) { return text.empty() ? DoctorJson(nullptr) : DoctorJson(text); }

std::vector<Notice> Shortages(const MachineState& machine) {
  constexpr double kLeastDisk = 2.0 * (1 << 30), kLeastMemory = 2.0 * (1 << 30);
  std::vector<Notice> warnings;
  for (const ProgramState& program : machine.programs)
    if (program.path.empty())
      warnings.push_back({"DOC-PROGRAM", program.name + " is not on the PATH", "needed for " + program.use});
  if (machine.disk_free_bytes < kLeastDisk)
    warnings.push_back(
        {"DOC-DISK", "only " + Gigabytes(machine.disk_free_bytes) + " are free at " + machine.disk_folder, "make room"});
  if (machine.available_bytes > 0 && machine.available_bytes < kLeastMemory)
    warnings.push_back(
        {"DOC-MEMORY", "only " + Gigabytes(machine.available_bytes) + " of memory are free", "end other programs"});
  if (machine.models.empty())
    warnings.push_back({"DOC-MODELS", "no models in " + machine.models_folder, "mvstudio models fetch"});
  return warnings;
}

DoctorJson MachineJson(const MachineState& machine, const ProgramFacts& program) {
  DoctorJson json = {{"version", program.version}, {"avatar", program.has_avatar}, {"libraries", DoctorJson::object()}};
  for (const auto& [name, version] : machine.libraries) json["libraries"][name] = version;
  json["cores"] = machine.cores;
  json["memory_bytes"] = {{"total", machine.memory_bytes}, {"available", machine.available_bytes}};
  json["disk_free_bytes"] = machine.disk_free_bytes;
  json["programs"] = DoctorJson::object();
  for (const ProgramState& found : machine.programs) json["programs"][found.name] = TextOrNull(found.path);
  json["models"] = {{"folder", machine.models_folder}, {"there", machine.models}};
  json["gpu"] = {{"nvidia_driver", TextOrNull(machine.nvidia_driver)}, {"device", machine.has_gpu}};
  return json;
}

std::string MachineText(const MachineState& machine, const ProgramFacts& program) {
  const std::string libraries =
      Join(machine.libraries, ", ", [](const auto& library) { return library.first + " " + library.second; });
  return "mvstudio " + program.version + " (" + libraries + ")\n" + std::to_string(machine.cores) + " cores, " +
         Gigabytes(machine.available_bytes) + " of " + Gigabytes(machine.memory_bytes) + " memory free, " +
         Gigabytes(machine.disk_free_bytes) + " of disk free, " + (machine.has_gpu ? "an NVIDIA GPU" : "no GPU") + "\n";
}

CommandResult DescribeSession(const dataset::SessionReport& session) {
  CommandResult result = DescribeFootageFindings(session);
  result.metrics["footage"] = FootageJson(session);
  result.metrics["findings"] = DoctorJson::array();
  for (const Notice& found : session.findings)
    result.metrics["findings"].push_back(
        {{"severity", found.fails ? "error" : "warning"}, {"code", found.code}, {"text", found.text}});
  result.text += FootageText(session);
  return result;
}

}  // namespace

CommandResult Describe(const DoctorReport& report, const ProgramFacts& program) {
  CommandResult result;
  result.metrics = MachineJson(report.machine, program);
  result.warnings = Shortages(report.machine);
  Append(report.notes.warnings, &result.warnings);
  result.inputs = report.notes.inputs;
  result.text = MachineText(report.machine, program);
  if (!report.session) return result;
  result.Add(DescribeSession(*report.session));
  result.text += Counted(static_cast<int64_t>(result.errors.size()), "error") + ", " +
                 Counted(static_cast<int64_t>(result.warnings.size()), "warning") + "\n";
  return result;
}

}  // namespace mvstudio::stages
