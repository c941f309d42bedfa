#include <cmath>
#include <cstdio>

#include "avatar/io/compare_folders.h"
#include "cli/commands.h"
#include "core/error.h"

namespace mvstudio::cli {
namespace {

using Json = nlohmann::ordered_json;

struct MetricsArguments {
  std::string reference, other;
  bool per_picture = false;
};

Json Finite(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json ToJson(const avatar::SetDistance& fd) {
  return {{"value", Finite(fd.fd)},
          {"features", fd.features},
          {"n", fd.n},
          {"d", fd.d},
          {"floor", Finite(fd.floor)},
          {"kid", Finite(fd.kid.value)},
          {"kid_se", Finite(fd.kid.standard_error)}};
}

Json ToJson(const avatar::RegionScore& score) {
  return {{"ssim", Finite(score.ssim)}, {"ssim_luma", Finite(score.ssim_luma)}, {"psnr_db", Finite(score.psnr_db)}};
}

std::string Text(const avatar::SetDistance& fd) {
  char text[200];
  std::snprintf(text, sizeof text, "FD (%s) %.5g, between halves of the reference %.5g; kernel distance %.3g +- %.2g; n = %lld",
                fd.features.c_str(), fd.fd, fd.floor, fd.kid.value, fd.kid.standard_error, static_cast<long long>(fd.n));
  return text;
}

void AddUnmatched(const std::vector<std::string>& names, const std::string& folder, CommandResult* result) {
  if (names.empty()) return;
  result->exit = kExitPartial;
  result->warnings.push_back(
      {"MET-UNMATCHED",
       std::to_string(names.size()) + " pictures of " + folder + " have no partner; the first: " + names.front(),
       "both folders must hold the same file names"});
}

CommandResult MetricsOfFolders(const MetricsArguments& arguments, CommandContext& context) {
  const avatar::FolderComparison comparison = avatar::CompareFolders(arguments.reference, arguments.other, context.run);
  CommandResult result;
  result.metrics = ToJson(comparison.mean);
  result.metrics["n"] = comparison.pictures.size();
  result.metrics["psnr_infinite"] = comparison.psnr_infinite;
  result.metrics["fd"] = comparison.fd ? ToJson(*comparison.fd) : Json();
  if (arguments.per_picture) {
    result.metrics["pictures"] = Json::array();
    for (const auto& picture : comparison.pictures) {
      Json row = {{"name", picture.name}};
      row.update(ToJson(picture.score));
      result.metrics["pictures"].push_back(row);
    }
  }
  AddUnmatched(comparison.only_in_reference, arguments.reference, &result);
  AddUnmatched(comparison.only_in_other, arguments.other, &result);
  if (!comparison.fd)
    result.warnings.push_back(
        {"MET-NO-FD", "no Frechet distance: " + comparison.fd_missing, "give at least 4 pairs of one size, 32 px or more"});
  char line[200];
  std::snprintf(line, sizeof line, "%zu pairs: SSIM %.4f (luma %.4f), PSNR %.2f dB (%lld equal pairs left out)",
                comparison.pictures.size(), comparison.mean.ssim, comparison.mean.ssim_luma, comparison.mean.psnr_db,
                static_cast<long long>(comparison.psnr_infinite));
  result.text = line + (comparison.fd ? "\n" + Text(*comparison.fd) : std::string());
  return result;
}

bool IsFeatureFile(const std::string& path) {
  const std::string extension = ".safetensors";
  return path.size() > extension.size() && path.compare(path.size() - extension.size(), extension.size(), extension) == 0;
}

CommandResult RunMetrics(const MetricsArguments& arguments, CommandContext& context) {
  CommandResult result;
  if (IsFeatureFile(arguments.reference) != IsFeatureFile(arguments.other)) {
    throw UsageError("metrics compares two folders of pictures or two .safetensors files of features, not one of each");
  }
  if (IsFeatureFile(arguments.reference)) {
    const avatar::SetDistance fd = avatar::CompareFeatureFiles(arguments.reference, arguments.other, context.run);
    result.metrics["fd"] = ToJson(fd);
    result.text = Text(fd);
  } else {
    result = MetricsOfFolders(arguments, context);
  }
  result.inputs = {arguments.reference, arguments.other};
  return result;
}

}  // namespace

void RegisterMetrics(CLI::App& app, Registry& registry) {
  auto arguments = std::make_shared<MetricsArguments>();
  CLI::App* sub =
      app.add_subcommand("metrics", "SSIM, PSNR and Frechet distance of two folders of pictures, or of two files of features");
  sub->add_option("reference", arguments->reference,
                  "folder of pictures, or a .safetensors file with a tensor `features` (n, d)")
      ->required();
  sub->add_option("other", arguments->other, "the same file names, or features of the same kind")->required();
  sub->add_flag("--per-picture", arguments->per_picture, "list every pair in the metrics");
  registry.Add(sub, "metrics", [arguments](CommandContext& context) { return RunMetrics(*arguments, context); });
}

}  // namespace mvstudio::cli
