#include "stages/body_mesh/run.h"

#include <filesystem>
#include <map>
#include <vector>

#include "avatar/body/articulated_pose.h"
#include "avatar/body/files/atlas.h"
#include "avatar/body/files/obj_sequence.h"
#include "avatar/body/files/textured_person.h"
#include "core/choice/frame_choice.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "stages/frame_notice.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

/// The poses of the frames that were asked for, all of them where "all" is.
std::map<int, body::BodyPose> PosesOf(const body::PersonBody& person, const std::string& frames, const std::string& path,
                                      InputNotes* notes) {
  if (person.seen.empty()) throw FormatError(path, "pose", "holds no pose of any frame: there is nothing to write");
  std::vector<int> chosen;
  for (const auto& [frame, pose] : person.seen) chosen.push_back(frame);
  if (frames != "all") {
    const FrameChoice choice = KnownFrames("option 'frames'", ParseRanges("option 'frames'", frames), chosen, path);
    NoteFrames(choice.beyond, notes);
    chosen = choice.frames;
  }
  std::map<int, body::BodyPose> poses;
  for (const int frame : chosen) poses.emplace(frame, ToBodyPose(person.body, person.seen.at(frame)));
  return poses;
}

}  // namespace

BodyMeshReport RunBodyMesh(const BodyMeshOptions& options) {
  const bool in_folder = std::filesystem::is_directory(options.body);
  const std::string file = in_folder ? options.body + "/" + body::kPersonFileName : options.body;
  BodyMeshReport report;
  report.options = options;
  report.notes.inputs = {file};
  const body::TexturedPerson person = body::ReadPerson(file);
  const std::map<int, body::BodyPose> poses = PosesOf(person.person, options.frames, file, &report.notes);
  AtomicFolder folder(options.out, options.overwrite, {file});
  const body::AtlasPng atlas{dataset::EncodeImage(body::AtlasImage(person.textures), "body.png"), person.textures[0].width};
  body::WriteObjSequence(folder.work_path(), person.person.body, atlas, poses);
  folder.Commit();
  report.num_frames = poses.size();
  report.num_vertices = static_cast<int>(person.person.body.vertices.cols());
  report.num_faces = static_cast<int>(person.person.body.faces.cols());
  return report;
}

}  // namespace mvstudio::stages
