#include <filesystem>
#include <memory>

#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/nets/body_folder.h"
#include "stages/nets/texture/body_edit.h"

namespace mvstudio::cli {
namespace {

struct EditArguments {
  std::string body, out, picture, shape, body_template;
  bool overwrite = false;
  double frame_rate_hz = 30;
};

CommandResult RunEdit(const EditArguments& arguments) {
  namespace fs = std::filesystem;
  if (arguments.picture.empty() && arguments.shape.empty())
    throw UsageError("nothing is to be changed: give --picture, --shape or both");
  const std::string file = fs::is_directory(arguments.body) ? arguments.body + "/" + body::kPersonFileName : arguments.body;
  CommandResult result;
  result.folder = arguments.out, result.inputs = {file};
  for (const std::string& input : {arguments.picture, arguments.body_template}) {
    if (!input.empty() && fs::exists(input)) result.inputs.push_back(input);
  }
  const OutputFolder place(arguments.out, result.inputs, stages::BodyFolder::Names());
  const stages::BodyFolder folder(arguments.out, arguments.overwrite);
  body::TexturedPerson person = body::ReadPerson(file);
  stages::BodyEdit edit;
  if (!arguments.picture.empty()) stages::EditTexture(dataset::ReadImage(arguments.picture), arguments.picture, &person, &edit);
  if (!arguments.shape.empty()) stages::EditShape(arguments.shape, arguments.body_template, &person, &edit);
  result.metrics = stages::ToJson(edit);
  result.text = stages::ToTable(edit);
  result.Add(stages::DescribeBodyFolder(arguments.out, folder.Write(person, arguments.frame_rate_hz)));
  return result;
}

}  // namespace

void RegisterAvatarEdit(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<EditArguments>();
  CLI::App* sub = avatar.add_subcommand("edit", "Change the colours or the shape of a fitted body by hand");
  AddOption(sub, "body", a->body, "fitted body: body.npz or the folder with it")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "folder for the changed body")->required();
  AddOption(sub, "--picture", a->picture,
            "its texture.png after a paint program, of the same size, or with charts of a multiple of theirs");
  AddOption(
      sub, "--shape", a->shape,
      "what is added to its shape, NAME=NUMBER,...: trunk, head, arm, leg (girths: 0.1 is a tenth thicker), and the blend "
      "shapes of --template in its units");
  AddOption(sub, "--template", a->body_template, "what the body was fitted to, for its blend shapes");
  AddOption(sub, "--fps", a->frame_rate_hz, "frames a second of the motion in body.glb")->check(CLI::Range(0.1, 1000.0));
  AddFlag(sub, "--overwrite", a->overwrite, "replace an older body in --out");
  registry.Add(sub, "avatar edit", [a](CommandContext&) { return RunEdit(*a); });
}

}  // namespace mvstudio::cli
