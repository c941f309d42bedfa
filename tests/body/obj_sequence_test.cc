#include "avatar/body/files/obj_sequence.h"

#include <algorithm>
#include <array>
#include <map>
#include <sstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "tests/body/posed.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

/// What a reader of OBJ makes of a file: one row of numbers per line, by the line's first word.
std::map<std::string, std::vector<std::vector<float>>> Lines(const std::string& obj) {
  std::map<std::string, std::vector<std::vector<float>>> lines;
  std::istringstream text(obj);
  for (std::string line; std::getline(text, line);) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    std::vector<float> row;
    for (std::string word; words >> word;) {
      std::replace(word.begin(), word.end(), '/', ' ');
      std::istringstream numbers(word);
      for (float number = 0; numbers >> number;) row.push_back(number);
    }
    lines[key].push_back(row);
  }
  return lines;
}

TEST(Obj, CornersKeepTheirVertexAndTexture) {
  const BodyTemplate body = MakeMannequin(1.75, 0.3);
  auto lines = Lines(ObjOfBody(body, body.vertices, 64, "body.mtl"));
  ASSERT_EQ(lines["v"].size(), static_cast<size_t>(body.vertices.cols()));
  ASSERT_EQ(lines["vn"].size(), static_cast<size_t>(body.vertices.cols()));
  ASSERT_EQ(lines["f"].size(), static_cast<size_t>(body.faces.cols()));
  for (Eigen::Index f = 0; f < body.faces.cols(); ++f) {
    const std::vector<float>& row = lines["f"][static_cast<size_t>(f)];
    ASSERT_EQ(row.size(), 9u);
    for (int k = 0; k < 3; ++k) {
      const auto vertex = static_cast<size_t>(row[static_cast<size_t>(3 * k)]) - 1;
      const auto texture = static_cast<size_t>(row[static_cast<size_t>(3 * k + 1)]) - 1;
      EXPECT_EQ(row[static_cast<size_t>(3 * k + 2)], row[static_cast<size_t>(3 * k)]);
      EXPECT_EQ(static_cast<int>(vertex), body.faces(k, f));
      const Eigen::Vector3f place = body.vertices.col(body.faces(k, f));
      EXPECT_THAT(lines["v"][vertex], ElementsAre(place.x(), place.y(), place.z()));
      const Eigen::Vector2f uv = AtlasUv(body.face_part[static_cast<size_t>(f)], body.face_uv.col(3 * f + k), 64);
      EXPECT_THAT(lines["vt"].at(texture), ElementsAre(uv.x(), 1 - uv.y()));
    }
  }
}

using Rows = std::vector<std::vector<float>>;

/// Volume and area of the triangles of `faces` with the vertices moved by `step` along their normals, as a reader of OBJ sees
/// them: corners by `v` and `vn`, counter-clockwise seen from outside.
std::array<double, 2> VolumeAndArea(const Rows& vertices, const Rows& normals, const Rows& faces, double step) {
  std::array<double, 2> sum{};
  for (const std::vector<float>& face : faces) {
    Eigen::Vector3d corner[3];
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3f v(vertices[static_cast<size_t>(face[3 * k]) - 1].data()),
          n(normals[static_cast<size_t>(face[3 * k + 2]) - 1].data());
      EXPECT_NEAR(n.norm(), 1, 1e-6);
      corner[k] = v.cast<double>() + step * n.cast<double>();
    }
    sum[0] += corner[0].dot(corner[1].cross(corner[2])) / 6;
    sum[1] += (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm() / 2;
  }
  return sum;
}

/// three.js reads it so, too (OBJLoader, MTLLoader: the image of the posed body is that of its .glb).
TEST(Obj, FacesAndNormalsPointOutwards) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  auto lines = Lines(ObjOfBody(body, SkinVertices(body, ToBodyPose(body, Dance(body, 3)[2])), 64, "body.mtl"));
  const auto [volume, area] = VolumeAndArea(lines["v"], lines["vn"], lines["f"], 0);
  EXPECT_GT(volume, 0.05);
  // Steiner: a smooth surface that moves outwards by h encloses h times its area more. Here it is the mean cosine between the
  // normals of faces and of their vertices.
  const double grown = VolumeAndArea(lines["v"], lines["vn"], lines["f"], 1e-4)[0] - volume;
  EXPECT_GT(grown / (1e-4 * area), 0.9);
  EXPECT_LT(grown / (1e-4 * area), 1.001);
}

TEST(Obj, SequenceOfPosedBodies) {
  const TempDir folder;
  const BodyTemplate body = Flag();
  const std::vector<ArticulatedPose> poses = Dance(body, 2);
  WriteObjSequence(folder.path(), body, BlackAtlas(32), {{7, ToBodyPose(body, poses[0])}, {120, ToBodyPose(body, poses[1])}});
  EXPECT_EQ(ReadFile(folder / "body.png"), BlackAtlas(32).bytes);
  EXPECT_THAT(ReadFile(folder / "body.mtl"), HasSubstr("newmtl body\n"));
  EXPECT_THAT(ReadFile(folder / "body.mtl"), HasSubstr("map_Kd body.png\n"));
  const std::string second = ReadFile(folder / "FRAME_00000120.obj");
  EXPECT_EQ(second, ObjOfBody(body, SkinVertices(body, ToBodyPose(body, poses[1])), 32, "body.mtl"));
  EXPECT_NE(second, ReadFile(folder / "FRAME_00000007.obj"));
  EXPECT_THAT(second, HasSubstr("mtllib body.mtl\n"));
  EXPECT_THAT(second, HasSubstr("f 1/1/1 2/2/2 3/3/3\nf 1/4/1 3/5/3 4/6/4\n"));
}

TEST(Obj, RefusesOtherVertices) {
  const BodyTemplate body = Flag();
  EXPECT_THROW(ObjOfBody(body, body.vertices.leftCols(3), 32, "body.mtl"), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::body
