#include <filesystem>
#include <map>
#include <memory>

#include "avatar/body/articulated_pose.h"
#include "avatar/body/files/atlas.h"
#include "avatar/body/files/obj_sequence.h"
#include "avatar/body/files/textured_person.h"
#include "cli/program/commands.h"
#include "cli/program/options.h"
#include "core/choice/frame_choice.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "dataset/footage/image_io.h"
#include "stages/frame_notice.h"

/// `avatar mesh`, which does without libtorch.
namespace mvstudio::cli {
namespace {

struct MeshArguments {
  std::string body, out, frames = "all";
  bool overwrite = false;
};

/// The poses of the frames that were asked for, all of them where "all" is.
std::map<int, body::BodyPose> PosesOf(const body::PersonBody& person, const std::string& frames, const std::string& path,
                                      stages::InputNotes* notes) {
  if (person.seen.empty()) throw FormatError(path, "pose", "holds no pose of any frame: there is nothing to write");
  std::map<int, body::BodyPose> poses;
  if (frames == "all") {
    for (const auto& [frame, pose] : person.seen) poses.emplace(frame, ToBodyPose(person.body, pose));
    return poses;
  }
  std::vector<int> known;
  for (const auto& [frame, pose] : person.seen) known.push_back(frame);
  const FrameChoice choice = KnownFrames("--frames", ParseRanges("--frames", frames), known, path);
  stages::NoteFrames(choice.beyond, notes);
  for (const int frame : choice.frames) poses.emplace(frame, ToBodyPose(person.body, person.seen.at(frame)));
  return poses;
}

CommandResult RunMesh(const MeshArguments& arguments) {
  const bool in_folder = std::filesystem::is_directory(arguments.body);
  const std::string file = in_folder ? arguments.body + "/" + body::kPersonFileName : arguments.body;
  CommandResult result;
  const body::TexturedPerson person = body::ReadPerson(file);
  const std::map<int, body::BodyPose> poses = PosesOf(person.person, arguments.frames, file, &result);
  AtomicFolder folder(arguments.out, arguments.overwrite, {file});
  const body::AtlasPng atlas{dataset::EncodeImage(body::AtlasImage(person.textures), "body.png"), person.textures[0].width};
  body::WriteObjSequence(folder.work_path(), person.person.body, atlas, poses);
  folder.Commit();
  result.folder = arguments.out, result.inputs = {file};
  result.outputs = {{arguments.out, "meshes"}};
  result.metrics = {
      {"frames", poses.size()}, {"vertices", person.person.body.vertices.cols()}, {"faces", person.person.body.faces.cols()}};
  result.text = Format("%s: %zu meshes of %d vertices, body.mtl and body.png\n", arguments.out.c_str(), poses.size(),
                       static_cast<int>(person.person.body.vertices.cols()));
  return result;
}

}  // namespace

void RegisterAvatarMesh(CLI::App& avatar, Registry& registry) {
  auto a = std::make_shared<MeshArguments>();
  CLI::App* sub = avatar.add_subcommand("mesh", "A fitted body as one OBJ mesh a frame, with its texture");
  AddOption(sub, "body", a->body, "fitted body: body.npz or the folder with it")->required();
  AddOutput(sub, "--out", a->out, OutputKind::kFolder, "new folder for FRAME_00000000.obj, …, body.mtl and body.png")
      ->required();
  AddOption(sub, "--frames", a->frames, "80-99 or 1,4,7-9, or all that the body has a pose of");
  AddFlag(sub, "--overwrite", a->overwrite, "replace the output folder");
  registry.Add(sub, "avatar mesh", [a](CommandContext&) { return RunMesh(*a); });
}

}  // namespace mvstudio::cli
