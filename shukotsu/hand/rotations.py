"""Rotations as arrays of unit quaternions (w, x, y, z) and 3 x 3 matrices.

A quaternion and its negative are the same rotation, and are treated as such by every function. Directions:
`rotate(q, v)` and `matrix(q) @ v` convert v from the receiver's frame to the transmitter's.
"""

from __future__ import annotations

import numpy as np

from shukotsu.arrays import Array as Array
from shukotsu.arrays import Float

_TINY = 1e-300


def matrix(quaternion: Float[Array, "*n 4"]) -> Float[Array, "*n 3 3"]:
    """Compute the rotation matrices of unit quaternions.

    Parameters
    ----------
    quaternion : array, shape (..., 4)
        Unit quaternions (w, x, y, z).

    Returns
    -------
    array, shape (..., 3, 3)
        The same rotations.

    """
    w, x, y, z = (quaternion[..., part] for part in range(4))
    out = np.empty((*quaternion.shape[:-1], 3, 3))
    out[..., 0, 0] = 1 - 2 * (y * y + z * z)
    out[..., 0, 1] = 2 * (x * y - w * z)
    out[..., 0, 2] = 2 * (x * z + w * y)
    out[..., 1, 0] = 2 * (x * y + w * z)
    out[..., 1, 1] = 1 - 2 * (x * x + z * z)
    out[..., 1, 2] = 2 * (y * z - w * x)
    out[..., 2, 0] = 2 * (x * z - w * y)
    out[..., 2, 1] = 2 * (y * z + w * x)
    out[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return out


def from_matrix(rotation: Float[Array, "*n 3 3"]) -> Float[Array, "*n 4"]:
    """Compute the unit quaternions of rotation matrices, by the best conditioned of Shepperd's four formulas.

    Shepperd 1978, J Guid Control 1:223.

    Parameters
    ----------
    rotation : array, shape (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    array, shape (..., 4)
        Unit quaternions (w, x, y, z), w >= 0.

    """
    m = rotation
    trace = m[..., 0, 0] + m[..., 1, 1] + m[..., 2, 2]
    squares = np.stack([trace, *(2 * m[..., i, i] - trace for i in range(3))], -1) + 1.0
    best = np.argmax(squares, -1)
    big = np.sqrt(np.maximum(np.take_along_axis(squares, best[..., None], -1), _TINY))
    a, b, c = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    d, e, f = m[..., 1, 0] + m[..., 0, 1], m[..., 0, 2] + m[..., 2, 0], m[..., 2, 1] + m[..., 1, 2]
    square = big[..., 0] ** 2
    rows = np.stack(
        [
            np.stack([square, a, b, c], -1),
            np.stack([a, square, d, e], -1),
            np.stack([b, d, square, f], -1),
            np.stack([c, e, f, square], -1),
        ],
        -2,
    )
    quaternion = np.take_along_axis(rows, best[..., None, None], -2)[..., 0, :] / (2 * big)
    return np.asarray(np.where(quaternion[..., :1] < 0, -quaternion, quaternion))


def multiply(first: Float[Array, "*#n 4"], second: Float[Array, "*#n 4"]) -> Float[Array, "*n 4"]:
    """Compute the Hamilton product: the rotation `second`, then the rotation `first`.

    Parameters
    ----------
    first, second : array, shape (..., 4)
        Quaternions (w, x, y, z); the shapes broadcast.

    Returns
    -------
    array, shape (..., 4)
        Their product.

    """
    aw, ax, ay, az = (first[..., part] for part in range(4))
    bw, bx, by, bz = (second[..., part] for part in range(4))
    w = aw * bw - ax * bx - ay * by - az * bz
    out = np.empty((*w.shape, 4))
    out[..., 0] = w
    out[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    out[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    out[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return out


def conjugate(quaternion: Float[Array, "*n 4"]) -> Float[Array, "*n 4"]:
    """Compute inverse rotations.

    Parameters
    ----------
    quaternion : array, shape (..., 4)
        Unit quaternions (w, x, y, z).

    Returns
    -------
    array, shape (..., 4)
        Unit quaternions of the inverse rotations.

    """
    return np.asarray(quaternion * np.array([1.0, -1.0, -1.0, -1.0]))


def rotate(quaternion: Float[Array, "*#n 4"], vector: Float[Array, "*#n 3"]) -> Float[Array, "*n 3"]:
    """Rotate vectors by unit quaternions: v + 2 w (q x v) + 2 q x (q x v).

    Parameters
    ----------
    quaternion : array, shape (..., 4)
        Unit quaternions (w, x, y, z), frame of the vectors to the frame of the result.
    vector : array, shape (..., 3)
        Vectors in any unit; the shapes broadcast.

    Returns
    -------
    array, shape (..., 3)
        Rotated vectors in the same unit.

    """
    w, x, y, z = (quaternion[..., part] for part in range(4))
    a, b, c = (vector[..., axis] for axis in range(3))
    u, v, t = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    out = np.empty((*u.shape, 3))  # v + w 2(q x v) + q x 2(q x v); written out, np.cross being slow
    out[..., 0] = a + w * u + y * t - z * v
    out[..., 1] = b + w * v + z * u - x * t
    out[..., 2] = c + w * t + x * v - y * u
    return out


def left_matrix(quaternion: Float[Array, " 4"]) -> Float[Array, "4 4"]:
    """Compute the matrix by which a quaternion multiplies others from the left.

    Parameters
    ----------
    quaternion : array, shape (4,)
        Quaternion (w, x, y, z).

    Returns
    -------
    array, shape (4, 4)
        L with L @ other = multiply(quaternion, other).

    """
    w, x, y, z = quaternion
    return np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])


def about_axis(axis: Array, angle_rad: Array | float) -> Array:
    """Compute rotations by angles about axes.

    Parameters
    ----------
    axis : array, shape (..., 3)
        Unit vectors.
    angle_rad : array, shape (...), or float
        Right-handed angles about the axes.

    Returns
    -------
    array, shape (..., 4)
        Unit quaternions (w, x, y, z).

    """
    half = np.asarray(angle_rad, float)[..., None] / 2
    vector = np.sin(half) * axis
    return np.concatenate([np.broadcast_to(np.cos(half), (*vector.shape[:-1], 1)), vector], -1)


def angle(quaternion: Float[Array, "*n 4"]) -> Float[Array, "*n"]:
    """Compute rotation angles.

    Parameters
    ----------
    quaternion : array, shape (..., 4)
        Unit quaternions (w, x, y, z).

    Returns
    -------
    array, shape (...)
        Angles, 0 to pi rad.

    """
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1)
    return np.asarray(2.0 * np.arctan2(sine, np.abs(quaternion[..., 0])))


def nearest_rotation(m: Float[Array, "*n 3 3"]) -> Float[Array, "*n 3 3"]:
    """Compute the rotation matrix that is nearest (Frobenius) to each matrix, by its singular values.

    Parameters
    ----------
    m : array, shape (..., 3, 3)
        Matrices of rank two or three.

    Returns
    -------
    array, shape (..., 3, 3)
        Rotation matrices.

    """
    u, _, vt = np.linalg.svd(m)
    u[..., :, 2] *= np.linalg.det(u @ vt)[..., None]
    return np.asarray(u @ vt)


def unit(vector: Float[Array, "*n d"]) -> Float[Array, "*n d"]:
    """Scale vectors to length one.

    Parameters
    ----------
    vector : array, shape (..., d)
        Vectors in any unit.

    Returns
    -------
    array, shape (..., d)
        Unit vectors; zero vectors are left as they are.

    """
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.where(length > 0, length, 1.0))


def bone_frame(direction: Float[Array, "*#n 3"], dorsal: Float[Array, "*#n 3"]) -> Float[Array, "*n 3 3"]:
    """Compute the frames of bones: x along the bone, z dorsal, y = z x x.

    Parameters
    ----------
    direction, dorsal : array, shape (..., 3)
        Vectors along the bone and approximately dorsal, in a common frame; neither zero nor parallel. The
        shapes broadcast.

    Returns
    -------
    array, shape (..., 3, 3)
        Rotation matrices, from the bone's frame to that of the vectors.

    """
    x = unit(direction)
    z = unit(dorsal - x * np.sum(x * dorsal, -1, keepdims=True))
    return np.stack([x, np.cross(z, x), z], -1)


def mean_rotation(quaternion: Float[Array, "n 4"]) -> Float[Array, " 4"]:
    """Compute the mean of rotations, which does not depend on the signs of the quaternions.

    It is the eigenvector of the largest eigenvalue of the sum of their outer products (Markley et al. 2007, J
    Guid Control Dyn 30:1193).

    Parameters
    ----------
    quaternion : array, shape (N, 4)
        Unit quaternions (w, x, y, z).

    Returns
    -------
    array, shape (4,)
        Unit quaternion, w >= 0; the identity if N is 0.

    """
    if not len(quaternion):
        return np.array([1.0, 0.0, 0.0, 0.0])
    mean = np.linalg.eigh(quaternion.T @ quaternion)[1][:, -1]
    return np.asarray(-mean if mean[0] < 0 else mean)


def cross(a: Float[Array, "*#n 3"], b: Float[Array, "*#n 3"]) -> Float[Array, "*n 3"]:
    """Compute cross products, written out since np.cross is slow.

    Parameters
    ----------
    a, b : array, shape (..., 3)
        Vectors; the shapes broadcast.

    Returns
    -------
    array, shape (..., 3)
        a x b.

    """
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def cross_matrix(vector: Float[Array, "*n 3"]) -> Float[Array, "*n 3 3"]:
    """Compute the matrices of cross products.

    Parameters
    ----------
    vector : array, shape (..., 3)
        Vectors v.

    Returns
    -------
    array, shape (..., 3, 3)
        K with K @ other = v x other.

    """
    x, y, z = (vector[..., axis] for axis in range(3))
    out = np.zeros((*vector.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out


def exp_rotation(vector: Float[Array, "*n 3"]) -> Float[Array, "*n 3 3"]:
    """Compute the rotation matrices of rotation vectors, by Rodrigues' formula.

    Parameters
    ----------
    vector : array, shape (..., 3)
        Axis times angle, rad.

    Returns
    -------
    array, shape (..., 3, 3)
        Rotation matrices.

    """
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    outer = vector[..., :, None] * vector[..., None, :]  # K K = v v^T - |v|^2, K being the cross matrix
    once, twice = np.sinc(angle / np.pi), np.sinc(angle / (2 * np.pi)) ** 2 / 2
    return np.asarray(np.eye(3) * (1.0 - twice * angle**2) + once * cross_matrix(vector) + twice * outer)


def turn_angles(relative: Float[Array, "T 4"], axes: Float[Array, "3 3"]) -> Float[Array, "T 3"]:
    """Compute the angles of intrinsic rotations about three axes at right angles.

    R = R(axes[0], q1) R(axes[1], q2) R(axes[2], q3). Angles are continuous over the frames, so that they may
    leave (-pi, pi]; q2 of the first frame is within [-pi / 2, pi / 2].

    Parameters
    ----------
    relative : array, shape (T, 4)
        Unit quaternions (w, x, y, z).
    axes : array, shape (3, 3)
        Unit axes in rows, right- or left-handed.

    Returns
    -------
    array, shape (T, 3)
        q1, q2, q3, rad.

    """
    hand = np.array([1.0, 1.0, np.sign(np.linalg.det(axes))])
    basis = axes * hand[:, None]
    angles = body_fixed_rad(matrix(np.concatenate([relative[:, :1], relative[:, 1:] @ basis.T], -1)))
    return np.asarray(continuous_angles(angles) * hand)


def body_fixed_rad(rotation: Float[Array, "*n 3 3"]) -> Float[Array, "*n 3"]:
    """Compute the angles about x, y and z of rotations, R = Rx Ry Rz, as defined in OpenSim.

    The last angle follows from the rotation that remains after the first two, so that R is reproduced even at
    90 deg about y.

    Parameters
    ----------
    rotation : array, shape (..., 3, 3)
        Rotation matrices.

    Returns
    -------
    array, shape (..., 3)
        Angles, rad.

    """
    m = rotation
    first = np.arctan2(-m[..., 1, 2], m[..., 2, 2])
    sine, cosine = np.sin(first)[..., None], np.cos(first)[..., None]
    side, front = cosine * m[..., 1, :] + sine * m[..., 2, :], cosine * m[..., 2, :] - sine * m[..., 1, :]
    second = np.arctan2(m[..., 0, 2], front[..., 2])
    return np.stack([first, second, np.arctan2(side[..., 0], side[..., 1])], -1)


def continuous(quaternion: Float[Array, "T n 4"]) -> Float[Array, "T n 4"]:
    """Choose signs that put successive known quaternions of a series, as 4-vectors, within 90 deg.

    Parameters
    ----------
    quaternion : array, shape (T, N, 4)
        N series of unit quaternions (w, x, y, z), NaN in gaps.

    Returns
    -------
    array, shape (T, N, 4)
        The same rotations; the first known quaternion of each series has w >= 0.

    """
    out = quaternion.copy()
    for index in range(quaternion.shape[1]):
        finite = np.isfinite(quaternion[:, index]).all(-1)
        if finite.any():
            series = quaternion[finite, index]
            start = -1.0 if series[0, 0] < 0 else 1.0
            turns = np.where(np.sum(series[1:] * series[:-1], -1) < 0, -1.0, 1.0)
            out[finite, index] = series * np.cumprod(np.concatenate([[start], turns]))[:, None]
    return out


def continuous_angles(angles_rad: Float[Array, "T *n 3"]) -> Float[Array, "T *n 3"]:
    """Make angles of rotations about three axes at right angles continuous over time.

    Every rotation has two triples of angles, (a, b, c) and (a + 180, 180 - b, c + 180 deg). The one nearer to
    the previous frame is chosen, then unwrapped. The first frame is kept.

    Parameters
    ----------
    angles_rad : array, shape (T, ..., 3)
        Angles computed for each frame separately, rad.

    Returns
    -------
    array, shape (T, ..., 3)
        Angles of the same rotations, rad.

    """
    other = angles_rad * np.array([1.0, -1.0, 1.0]) + np.pi
    swapped = _distance(other[1:], angles_rad[:-1]) < _distance(angles_rad[1:], angles_rad[:-1])
    # the second triples of two frames are as far from each other as the first ones
    swapped = np.concatenate([np.zeros((1, *swapped.shape[1:]), bool), swapped])
    second = np.logical_xor.accumulate(swapped, axis=0)
    return np.asarray(np.unwrap(np.where(second[..., None], other, angles_rad), axis=0))


def _distance(first: Array, second: Array) -> Array:
    """Return the sum of the distances (...) of three angles, rad, modulo full turns."""
    return np.asarray(np.abs(np.mod(first - second + np.pi, 2 * np.pi) - np.pi).sum(-1))
