#include "core/disk/npy_write.h"
#include "fuzz/fuzz.h"
#include "geometry/lens/models.h"
#include "splats/files/cloud_file.h"
#include "splats/files/ply.h"
#include "splats/project.h"

/// Gaussians: of a run, and for viewers.
namespace mvstudio::fuzz {
namespace {

/// A square of two triangles, 2 m before the camera of FrontCamera, on two bones.
body::BodyTemplate Square() {
  body::BodyTemplate body;
  body.vertices.resize(3, 4);
  body.vertices << 0, 1, 1, 0, 0, 0, 1, 1, 2, 2, 2, 2;
  body.faces.resize(3, 2);
  body.faces << 0, 0, 1, 2, 2, 3;
  body.skin_bones = Eigen::Matrix4Xi::Zero(4, 4);
  body.skin_bones.row(1).setOnes();
  body.skin_weights = Eigen::Matrix4Xf::Zero(4, 4);
  body.skin_weights.topRows(2).setConstant(0.5f);
  body.bone_names = {"pole", "arm"};
  return body;
}

/// Whatever a file holds, each Gaussian is shown or counted.
void RequireShown(const splats::Cloud& cloud, const body::BodyTemplate& body) {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("front", 32, 32, 20);
  const Eigen::Matrix3Xf& vertices = body.vertices;
  const auto projected = splats::ProjectSplats<float>(cloud, {body.faces, vertices}, splats::ViewOf<float>(camera), {});
  const splats::SkippedSplats& skipped = projected.skipped;
  Require(projected.splats.size() + static_cast<size_t>(skipped.degenerate + skipped.behind_camera + skipped.not_finite) <=
              cloud.size(),
          "more Gaussians in the image than in the file");
  for (const splats::Splat<float>& splat : projected.splats)
    Require(std::isfinite(splat.x + splat.y + splat.a + splat.b + splat.c + splat.rgb[0] + splat.rgb[1] + splat.rgb[2]),
            "a Gaussian that is not finite in the image");
}

}  // namespace

/// The arrays of the archive in the order below, as parts: its checksums would stop every mutation.
MVS_FUZZ_TARGET(gaussians_npz, bytes) {
  const char* names[] = {
      "schema", "seed",     "mip",       "size_px",  "step",    "train_s", "degree", "face", "filter_variance_m2",
      "place",  "offset_m", "log_scale", "rotation", "opacity", "colour",  "options"};
  std::vector<std::pair<std::string, std::string>> members;
  for (const std::string_view part : Parts(bytes, std::size(names))) members.emplace_back(names[members.size()], part);
  if (members.back().second.empty()) members.pop_back();
  const body::BodyTemplate body = Square();
  splats::CloudFile file;
  if (!Accepts([&] { file = splats::ParseCloud(NpzOf(members), "a.npz", 2); })) return;
  std::string written, again;
  Require(Accepts([&] { written = splats::CloudFileBytes(file, body); }), "what was read cannot be written");
  Require(Accepts([&] { again = splats::CloudFileBytes(splats::ParseCloud(written, "b.npz", 2), body); }), "nor read again");
  Require(written == again, "Gaussians change when they are written and read");
  RequireShown(file.cloud, body);
  Require(Accepts([&] { splats::ParsePly(splats::PlyBytes(splats::ToPly(file.cloud, body.faces, body.vertices)), "a.ply"); }),
          "Gaussians that viewers cannot read");
}

MVS_FUZZ_TARGET(gaussians_ply, bytes) {
  splats::PlySplats splats;
  if (!Accepts([&] { splats = splats::ParsePly(std::string(bytes), "a.ply"); })) return;
  std::string written, again;
  Require(Accepts([&] { written = splats::PlyBytes(splats); }), "what was read cannot be written");
  Require(Accepts([&] { again = splats::PlyBytes(splats::ParsePly(written, "b.ply")); }), "nor read again");
  Require(written == again, "Gaussians change when they are written and read");
}

}  // namespace mvstudio::fuzz
