#include "avatar/body/files/obj_sequence.h"

#include <vector>

#include "avatar/body/surface_nets.h"
#include "core/check.h"
#include "core/disk/files.h"
#include "core/format.h"
#include "core/text/shortest_text.h"

namespace mvstudio::body {
namespace {

template <class Column>
void AppendRow(const char* key, const Column& values, std::string* text) {
  *text += key;
  for (Eigen::Index i = 0; i < values.size(); ++i) *text += ' ', AppendShortestText(values(i), text);
  *text += '\n';
}

/// `vertex/texture/normal` of the three corners, counted from 1.
void AppendFace(const AtlasMesh& mesh, Eigen::Index face, std::string* text) {
  *text += 'f';
  for (int k = 0; k < 3; ++k) {
    const int corner = mesh.faces(k, face);
    const std::string vertex = std::to_string(mesh.vertices[static_cast<size_t>(corner)] + 1);
    *text += ' ' + vertex + '/' + std::to_string(corner + 1) + '/' + vertex;
  }
  *text += '\n';
}

/// Lines that all frames share: texture coordinates, v up from the bottom, and after the vertices the faces.
struct SharedLines {
  std::string head, uv, faces;
};

SharedLines SharedLinesOf(const BodyTemplate& body, int chart_px, const std::string& material_file) {
  const AtlasMesh mesh = UnwrapOntoAtlas(body, chart_px);
  SharedLines lines{"# mvstudio: metres, z up\nmtllib " + material_file + "\no body\n", "", "usemtl body\n"};
  for (Eigen::Index i = 0; i < mesh.uv.cols(); ++i)
    AppendRow("vt", Eigen::Vector2f(mesh.uv(0, i), 1 - mesh.uv(1, i)), &lines.uv);
  for (Eigen::Index f = 0; f < mesh.faces.cols(); ++f) AppendFace(mesh, f, &lines.faces);
  return lines;
}

std::string ObjText(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices, const SharedLines& shared) {
  MVS_CHECK(vertices.cols() == body.vertices.cols(), vertices.cols() << " vertices instead of " << body.vertices.cols());
  MVS_CHECK(vertices.allFinite(), "a vertex is not finite");
  std::string text = shared.head;
  for (Eigen::Index i = 0; i < vertices.cols(); ++i) AppendRow("v", vertices.col(i), &text);
  text += shared.uv;
  const Eigen::Matrix3Xf normals = VertexNormals(vertices, body.faces);
  for (Eigen::Index i = 0; i < normals.cols(); ++i) AppendRow("vn", normals.col(i), &text);
  return text + shared.faces;
}

}  // namespace

std::string ObjOfBody(const BodyTemplate& body, const Eigen::Matrix3Xf& vertices, int chart_px,
                      const std::string& material_file) {
  return ObjText(body, vertices, SharedLinesOf(body, chart_px, material_file));
}

std::string MtlOfBody(const std::string& texture_file) {
  return "newmtl body\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nillum 1\nmap_Kd " + texture_file + "\n";
}

void WriteObjSequence(const std::string& folder, const BodyTemplate& body, const AtlasPng& atlas,
                      const std::map<int, BodyPose>& pose_of_frame) {
  CheckAtlas(atlas);
  const SharedLines shared = SharedLinesOf(body, atlas.chart_px, "body.mtl");
  WriteFileAtomic(folder + "/body.png", atlas.bytes);
  WriteFileAtomic(folder + "/body.mtl", MtlOfBody("body.png"));
  for (const auto& [frame, pose] : pose_of_frame) {
    MVS_CHECK(frame >= 0, "frame " << frame);
    WriteFileAtomic(Format("%s/FRAME_%08d.obj", folder.c_str(), frame), ObjText(body, SkinVertices(body, pose), shared));
  }
}

}  // namespace mvstudio::body
