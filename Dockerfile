# The command line with the software renderer:
#   docker build -t aerialdojo-gen . && mkdir -p data
#   docker run --rm -u "$(id -u):$(id -g)" -v "$PWD/data:/data" aerialdojo-gen run pipelines/smoke.toml
# The image has PyAV, whose wheel bundles x264 and x265: who passes the image on passes on software under the GPL, too
# (README.md, "Licences").
FROM python:3.11-slim-bookworm@sha256:528257d48c1da0dcecc2e725d1ae34498d60c965f1241e39cd6a85a8859bdf84
RUN apt-get update && apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --uid 1000 dojo && install -d -o dojo /data /opt/aerialdojo-gen
WORKDIR /opt/aerialdojo-gen
COPY --chown=dojo . .
# Editable: a checkout's recipes and annotations are used where they lie, and pipelines/ can be named as README does.
RUN sed -n '/^uv==/,/[^\\]$/p' constraints.txt > /tmp/uv.txt \
    && pip install --no-cache-dir --require-hashes -r /tmp/uv.txt \
    && uv pip install --compile-bytecode --system --no-cache -c constraints.txt -b constraints.txt -e '.[gl,web]' \
    && python -m compileall -q aerialdojo_gen
USER dojo
# The planner's kernels, compiled once: beside the sources, from where another user's first run copies them.
RUN aerialdojo-gen plan --pipeline pipelines/smoke.toml --scene U_Courtyard_0 --data /tmp/smoke --workers 1 && rm -r /tmp/smoke
LABEL org.opencontainers.image.licenses="Apache-2.0 AND GPL-2.0-or-later"
ENV AERIALDOJO_DATA=/data
VOLUME /data
ENTRYPOINT ["aerialdojo-gen"]
CMD ["--help"]
