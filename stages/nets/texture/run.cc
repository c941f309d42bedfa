#include "stages/nets/texture/run.h"

#include <filesystem>

#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::stages {
namespace {

CommandResult DescribeChange(const BodyChange& change, nlohmann::ordered_json metrics, const std::string& text) {
  CommandResult result;
  result.folder = change.out, result.inputs = change.inputs;
  result.metrics = std::move(metrics), result.text = text;
  result.Add(DescribeBodyFolder(change.out, change.surface));
  return result;
}

}  // namespace

TextureReport RunTexture(const TextureSource& source, const TextureRunOptions& options, const RunContext& run) {
  TextureReport report;
  report.out = options.out, report.inputs = {options.source, source.data.root};
  const OutputFolder place(options.out, report.inputs, BodyFolder::Names());
  const BodyFolder folder(options.out, options.overwrite);
  report.made = MakeTexture(source, options.how, run);
  body::TexturedPerson person = source.body;
  person.textures = report.made.textures;
  report.surface = folder.Write(person, options.frame_rate_hz);
  return report;
}

EditReport RunEdit(const EditOptions& options) {
  namespace fs = std::filesystem;
  if (options.image.empty() && options.shape.empty())
    throw UsageError("nothing is to be changed: give option 'picture', option 'shape' or both");
  const std::string file = fs::is_directory(options.body) ? options.body + "/" + body::kPersonFileName : options.body;
  EditReport report;
  report.out = options.out, report.inputs = {file};
  for (const std::string& input : {options.image, options.body_template}) {
    if (!input.empty() && fs::exists(input)) report.inputs.push_back(input);
  }
  const OutputFolder place(options.out, report.inputs, BodyFolder::Names());
  const BodyFolder folder(options.out, options.overwrite);
  body::TexturedPerson person = body::ReadPerson(file);
  if (!options.image.empty()) EditTexture(dataset::ReadImage(options.image), options.image, &person, &report.edit);
  if (!options.shape.empty()) EditShape(options.shape, options.body_template, &person, &report.edit);
  report.surface = folder.Write(person, options.frame_rate_hz);
  return report;
}

CommandResult Describe(const TextureReport& report) {
  return DescribeChange(report, ToJson(report.made), ToTable(report.made));
}

CommandResult Describe(const EditReport& report) { return DescribeChange(report, ToJson(report.edit), ToTable(report.edit)); }

}  // namespace mvstudio::stages
